// What a mapping run leaves on disk: meshes, trajectories, statistics (docs/command-line.md).
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string_view>

#include "core/frame_source.h"
#include "mapper/pipeline.h"

namespace tsdfpp {

// Times of the steps over the frames of a run, for its statistics.
struct RunTimes {
  std::vector<double> segment_s;
  std::vector<double> locate_s;
  std::vector<double> associate_s;
  std::vector<double> track_s;
  std::vector<double> update_poses_s;
  std::vector<double> repair_s;
  std::vector<double> fuse_s;
  std::vector<double> mesh_s;  // of the visible scene, at the frames that were meshed

  void Add(const StepTimes& step);
  // Of all steps together (StepTimes::Total_s()), a frame.
  std::vector<double> All_s() const;
  // Median, p99 and worst of each step in milliseconds.
  nlohmann::json ToJson() const;
};

enum class MeshFormat { kPly, kGlb };

// "ply" or "glb". Errors: kUsage.
Expected<MeshFormat> MeshFormatFromName(std::string_view name);

// mesh/<name>-<id>.ply for each object, mesh/scene.ply, trajectories/<name>-<id>.txt and, where its
// poses were not given, the camera's trajectories/camera.txt below `out`;
// as .glb files (core/gltf.h), a node an object in the scene's, where that is the format.
// `map` is the map after removals, `pipeline` the run that it comes from.
// Errors: kEnvironment where the disk refuses.
Expected<void> WriteMap(const MapRepresentation& map, const Pipeline& pipeline,
                        const SequenceInfo& info, const std::filesystem::path& out,
                        MeshFormat format = MeshFormat::kPly);

}  // namespace tsdfpp
