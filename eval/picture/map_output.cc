#include "eval/picture/map_output.h"

#include <algorithm>

#include "core/files.h"
#include "core/gltf.h"
#include "core/ply.h"
#include "core/pose_text.h"
#include "eval/run/open_source.h"
#include "mapper/scene_mesher.h"
#include "metrics/statistics.h"

namespace tsdfpp {
namespace {

nlohmann::json Spread(std::vector<double> seconds) {
  if (seconds.empty()) return nullptr;
  std::sort(seconds.begin(), seconds.end());
  // The smallest value that a share p of all do not exceed.
  const auto quantile = [&](double p) {
    const auto rank = static_cast<std::size_t>(std::ceil(p * static_cast<double>(seconds.size())));
    return 1e3 * seconds[std::max<std::size_t>(rank, 1) - 1];
  };
  return {{"median_ms", 1e3 * MedianOf(seconds)},
          {"p99_ms", quantile(0.99)},
          {"worst_ms", quantile(1.0)}};
}

std::string TextOf(const std::map<int, Pose>& trajectory, std::string_view frames) {
  std::string text = fmt::format("# frame tx ty tz qx qy qz qw ({}, metres)\n", frames);
  for (const auto& [frame, pose] : trajectory) {
    text += fmt::format("{} {}\n", frame, PoseToText(pose));
  }
  return text;
}

}  // namespace

void RunTimes::Add(const StepTimes& step) {
  segment_s.push_back(step.segment_s);
  locate_s.push_back(step.locate_s);
  associate_s.push_back(step.associate_s);
  track_s.push_back(step.track_s);
  update_poses_s.push_back(step.update_poses_s);
  repair_s.push_back(step.repair_s);
  fuse_s.push_back(step.fuse_s);
}

std::vector<double> RunTimes::All_s() const {
  std::vector<double> all_s(fuse_s.size());
  for (const std::vector<double>* step :
       {&segment_s, &locate_s, &associate_s, &track_s, &update_poses_s, &repair_s, &fuse_s}) {
    for (std::size_t i = 0; i < all_s.size(); ++i) all_s[i] += (*step)[i];
  }
  return all_s;
}

nlohmann::json RunTimes::ToJson() const {
  return {{"segment", Spread(segment_s)},
          {"locate", Spread(locate_s)},
          {"associate", Spread(associate_s)},
          {"track", Spread(track_s)},
          {"update_poses", Spread(update_poses_s)},
          {"repair_masks", Spread(repair_s)},
          {"fuse", Spread(fuse_s)},
          {"mesh_scene", Spread(mesh_s)}};
}

Expected<MeshFormat> MeshFormatFromName(std::string_view name) {
  if (name == "ply") return MeshFormat::kPly;
  if (name == "glb") return MeshFormat::kGlb;
  return UsageError("mesh format '{}' is unknown, expected ply or glb", name);
}

Expected<void> WriteMap(const MapRepresentation& map, const Pipeline& pipeline,
                        const SequenceInfo& info, const std::filesystem::path& out,
                        MeshFormat format) {
  const bool glb = format == MeshFormat::kGlb;
  SceneMesher mesher;
  const std::vector<InstanceId> mapped = map.Objects();
  for (const ObjectInfo& object : info.objects) {
    if (std::find(mapped.begin(), mapped.end(), object.id) != mapped.end()) {
      TriangleMesh mesh = mesher.ObjectMesh(map, object.id);
      const std::filesystem::path stem = out / "mesh" / FileStem(object);
      if (glb) {
        TSDFPP_RETURN_IF_ERROR(
            WriteGlb(stem.string() + ".glb", {{object.name, object.id, std::move(mesh)}}));
      } else {
        mesh.face_ids.assign(mesh.triangles.size(), object.id);
        TSDFPP_RETURN_IF_ERROR(WritePly(stem.string() + ".ply", mesh));
      }
    }
    const auto trajectory = pipeline.trajectories().find(object.id);
    if (trajectory == pipeline.trajectories().end()) continue;
    TSDFPP_RETURN_IF_ERROR(WriteFile(out / "trajectories" / (FileStem(object) + ".txt"),
                                     TextOf(trajectory->second, "T_world_object")));
  }
  if (const auto& T_WC = pipeline.camera_log().T_WC; !T_WC.empty()) {
    TSDFPP_RETURN_IF_ERROR(
        WriteFile(out / "trajectories" / "camera.txt", TextOf(T_WC, "T_world_camera")));
  }
  if (!glb) return WritePly(out / "mesh" / "scene.ply", mesher.SceneMesh(map));
  const auto name_of = [&](InstanceId id) {
    for (const ObjectInfo& object : info.objects) {
      if (object.id == id) return object.name;
    }
    return fmt::format("object {}", id);
  };
  return WriteGlb(out / "mesh" / "scene.glb", SplitByFaceIds(mesher.SceneMesh(map), name_of));
}

}  // namespace tsdfpp
