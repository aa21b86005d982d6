#include "eval/score/evaluate_meshes.h"

#include <algorithm>

#include "eval/score/evaluation_columns.h"
#include "metrics/mesh_tools.h"
#include "metrics/surface_comparison.h"

namespace tsdfpp {
namespace {

Eigen::AlignedBox3f BoundsOfTruth(const SceneTruth& truth) {
  Eigen::AlignedBox3f box;
  for (const PlacedTruth& placed : truth.PlacedWithout({})) {
    const TriangleMesh& mesh_O = placed.surface->model().mesh_O;
    for (const Eigen::Vector3f& vertex : mesh_O.vertices) {
      box.extend((placed.T_WO * vertex.cast<double>()).cast<float>());
    }
  }
  return box;
}

Expected<void> CheckConfig(const SequenceInfo& info, const EvaluateConfig& config) {
  const int last = info.first_index + info.frame_count - 1;
  if (config.frames.empty()) return UsageError("--at is empty, expected a frame's number");
  for (const int frame : config.frames) {
    if (frame < info.first_index || frame > last) {
      return UsageError("--at {} is out of range: {} has frames {} to {}", frame, info.name,
                        info.first_index, last);
    }
    if (std::count(config.frames.begin(), config.frames.end(), frame) > 1) {
      return UsageError("--at names frame {} twice", frame);
    }
  }
  if (config.removed.contains(kBackground)) {
    return UsageError("--removed names the background, which cannot be removed");
  }
  return {};
}

std::string Cell(const Measured& measured, int decimals) {
  return measured.value ? fmt::format("{:.{}f}", *measured.value, decimals) : "-";
}

}  // namespace

Expected<PreparedMeshes> PrepareMeshes(const SceneTruth& truth,
                                       const std::vector<ObjectInfo>& objects,
                                       const EvaluateConfig& config) {
  const int frame = truth.recent().back().index;
  TSDFPP_ASSIGN(FrameMeshes loaded,
                ReadMeshFolder(config.meshes, frame, config.frames.size() == 1, config.scale));
  if (!config.scale_is_given) {
    TSDFPP_RETURN_IF_ERROR(CheckUnits(BoundsOf(loaded.scene.mesh), loaded.scene.source,
                                      BoundsOfTruth(truth), "the sequence's true surface"));
  }
  PreparedMeshes out;
  MatchedScene matched = MatchScene(loaded.scene, truth, objects, config.voxel_m, config.match);
  out.remarks = std::move(loaded.remarks);
  out.remarks.insert(out.remarks.end(), matched.remarks.begin(), matched.remarks.end());
  out.meshes.scene = std::move(matched.mesh);
  out.matches = std::move(matched.matches);
  out.meshes.labelled = !out.meshes.scene.face_ids.empty();
  const std::set<std::set<InstanceId>> removals = RemovalsOf(config.removed);
  for (const std::set<InstanceId>& removed : removals) {
    if (removed.empty()) continue;
    const auto given = loaded.without.find(removed);
    if (!out.meshes.labelled) continue;
    const bool is_given = given != loaded.without.end();
    if (is_given && given->second.parts.empty() && !given->second.mesh.triangles.empty()) {
      return DataError("{}: tells no objects apart, expected the labels of {}",
                       given->second.source, loaded.scene.source);
    }
    out.meshes.without[removed] = is_given ? WithMatches(given->second, out.matches, truth, objects,
                                                         config.voxel_m, config.match, out.remarks)
                                           : FacesWithout(out.meshes.scene, removed);
  }
  for (const auto& [removed, scene] : loaded.without) {
    if (removals.contains(removed) && out.meshes.labelled) continue;
    out.remarks.push_back(fmt::format(
        "{}: is left out, since {}", scene.source,
        out.meshes.labelled ? "no score asks for that removal" : "the scene has no labels"));
  }
  if (!out.meshes.labelled) {
    out.remarks.push_back(fmt::format(
        "{}: tells no objects apart: scores take faces of any label, nothing is removed",
        loaded.scene.source));
  }
  return out;
}

Expected<EvaluateResult> RunEvaluate(FrameSource& source, const EvaluateConfig& config,
                                     const std::function<void(int done, int total)>& progress) {
  EvaluateResult result;
  result.info = source.info();
  result.config = config;
  std::sort(result.config.frames.begin(), result.config.frames.end());
  const std::vector<int>& frames = result.config.frames;
  TSDFPP_RETURN_IF_ERROR(CheckConfig(result.info, config));
  // Before the frames are read, which takes longer.
  std::error_code failure;
  if (!std::filesystem::is_directory(config.meshes, failure)) {
    return UsageError("--meshes {}: no such folder", config.meshes.string());
  }
  std::optional<MaskEvaluator> masks;
  if (config.masks) {
    TSDFPP_ASSIGN(masks, MaskEvaluator::Open(*config.masks));
  }
  TSDFPP_ASSIGN(SceneTruth truth, SceneTruth::Create(source, config.truth));
  std::vector<ObjectInfo> names;
  for (std::size_t i = 0; i < truth.trackers().size(); ++i) {
    names.push_back(truth.surface(i).model().info);
  }
  LastSeenStores last_seen = MakeLastSeenStores(truth);
  Trajectory camera;
  const int first = result.info.first_index;
  const int total = frames.back() - first + 1;
  for (int index = first; index <= frames.back(); ++index) {
    TSDFPP_ASSIGN(const Frame frame,
                  source.IsSensed() ? source.ReadTrue(index) : source.Read(index));
    if (frame.mask.empty()) return DataError("{}: frame {} has no mask", result.info.name, index);
    TSDFPP_RETURN_IF_ERROR(truth.Observe(frame));
    camera[index] = frame.T_WC;
    if (masks) TSDFPP_RETURN_IF_ERROR(masks->Observe(frame));
    if (std::find(frames.begin(), frames.end(), index) != frames.end()) {
      TSDFPP_ASSIGN(PreparedMeshes prepared, PrepareMeshes(truth, names, result.config));
      EvaluatedFrame& evaluated = result.frames.emplace_back();
      evaluated.evaluation = EvaluateMeshes(std::move(prepared.meshes), truth, names,
                                            config.removed, config.voxel_m, last_seen);
      evaluated.evaluation.scene = {};
      evaluated.evaluation.revealed = {};
      evaluated.evaluation.table_reconstructed = {};
      evaluated.matches = std::move(prepared.matches);
      evaluated.remarks = std::move(prepared.remarks);
    }
    if (progress) progress(index - first + 1, total);
  }
  if (config.trajectories) {
    TSDFPP_ASSIGN(result.trajectories,
                  EvaluateTrajectories(*config.trajectories, names, result.frames.back().matches,
                                       truth.trajectories(), camera));
  }
  if (masks) {
    TSDFPP_ASSIGN(result.masks, masks->Result(result.info, names, config.match));
  }
  return result;
}

std::string EvaluateTable(const EvaluateResult& result) {
  std::string text = fmt::format("{}: {}, {} objects removed; threshold {:g} m\n", result.info.name,
                                 result.config.meshes.string(), result.config.removed.size(),
                                 result.config.voxel_m);
  text += fmt::format("{:<8}", "frame");
  for (const EvaluationColumn& column : EvaluationColumns()) {
    text += fmt::format("  {:>9}", column.title);
  }
  text += "\n";
  for (const EvaluatedFrame& frame : result.frames) {
    text += fmt::format("{:<8}", frame.evaluation.frame);
    for (const EvaluationColumn& column : EvaluationColumns()) {
      text += fmt::format("  {:>{}}", ColumnText(column, result.config.removed, frame.evaluation),
                          std::max<std::size_t>(9, column.title.size()));
    }
    text += frame.evaluation.labelled ? "\n" : "  (any label)\n";
  }
  if (!result.frames.empty() && !result.frames.back().matches.empty()) {
    text += fmt::format("matching at frame {}:\n", result.frames.back().evaluation.frame);
    for (const PartMatch& match : result.frames.back().matches) {
      text += fmt::format(
          "  {} is {} (by {}; {:.4g} m2, {} of it there)\n", match.part.source,
          match.object == kNoInstance ? "no object"
                                      : fmt::format("{} ({})", match.object_name, match.object),
          match.how, match.area_m2,
          match.share.value ? fmt::format("{:.1f} %", 100 * *match.share.value) : "none");
    }
  }
  if (result.trajectories) {
    for (const auto& [id, scores] : result.trajectories->objects) {
      text +=
          fmt::format("trajectory of {}: {} frames, ATE {} m, rotation {} deg\n", id, scores.frames,
                      Cell(scores.ate_rmse_m, 4), Cell(scores.rotation_rmse_deg, 2));
    }
    if (result.trajectories->camera_m) {
      text +=
          fmt::format("trajectory of the camera: {} frames, ATE {:.4f} m, rotation {:.2f} deg\n",
                      result.trajectories->camera_frames, result.trajectories->camera_m->rmse,
                      result.trajectories->camera_deg->rmse);
    }
  }
  if (result.masks) {
    text += fmt::format("masks: {} images, mean IoU {}, PQ {}\n", result.masks->images,
                        Cell(result.masks->mean_iou, 4), Cell(result.masks->quality.pq, 4));
  }
  return text;
}

nlohmann::json ToJson(const EvaluateResult& result) {
  nlohmann::json frames = nlohmann::json::array();
  for (const EvaluatedFrame& frame : result.frames) {
    nlohmann::json json = ToJson(frame.evaluation);
    json.erase("mesh_s");  // nothing was meshed
    json["matching"] = ToJson(frame.matches);
    json["remarks"] = frame.remarks;
    frames.push_back(std::move(json));
  }
  nlohmann::json json{{"schema", 1},
                      {"generator", "tsdfpp"},
                      {"version", TSDFPP_VERSION},
                      {"sequence", result.info.name},
                      {"meshes", result.config.meshes.string()},
                      {"voxel_m", result.config.voxel_m},
                      {"scale", result.config.scale},
                      {"samples_per_cm2", result.config.truth.sampling.fine_per_cm2},
                      {"removed", result.config.removed},
                      {"frames", frames}};
  if (result.trajectories) json["trajectories"] = ToJson(*result.trajectories);
  if (result.masks) json["masks"] = ToJson(*result.masks);
  return json;
}

}  // namespace tsdfpp
