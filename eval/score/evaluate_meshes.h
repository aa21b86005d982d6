// Scores the files that any mapper wrote (docs/evaluate.md), with the metrics of a comparison.
#pragma once

#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "core/frame_source.h"
#include "eval/score/evaluate_masks.h"
#include "eval/score/evaluate_trajectories.h"
#include "eval/score/evaluation.h"
#include "eval/score/mesh_matching.h"

namespace tsdfpp {

struct EvaluateConfig {
  std::filesystem::path meshes;                       // eval/score/mesh_folder.h
  std::optional<std::filesystem::path> trajectories;  // eval/score/evaluate_trajectories.h
  std::optional<std::filesystem::path> masks;         // eval/score/evaluate_masks.h
  std::vector<int> frames;                            // after which the meshes were made
  std::set<InstanceId> removed;                       // the objects that the experiment removes
  double scale = 1;                                   // metres a unit of the meshes
  bool scale_is_given = false;                        // else a mistaken unit is refused
  double voxel_m = 0.01;                              // the scores' threshold
  MatchMode match = MatchMode::kNames;
  TruthOptions truth;
};

struct EvaluatedFrame {
  Evaluation evaluation;  // without meshes
  std::vector<PartMatch> matches;
  std::vector<std::string> remarks;
};

struct EvaluateResult {
  SequenceInfo info;
  EvaluateConfig config;
  std::vector<EvaluatedFrame> frames;  // in order
  std::optional<TrajectoryEvaluation> trajectories;
  std::optional<MaskEvaluation> masks;
};

// Follows the truth up to the last of the frames and scores the meshes at each of them; retention
// is between these. Faces of the removed objects are dropped from the scene, unless the folder has
// the scene after the removal.
// Errors: kUsage where a frame or a removed object is not the sequence's, those of ReadMeshFolder
// and of CheckUnits, of the source, of trajectories and masks.
Expected<EvaluateResult> RunEvaluate(FrameSource& source, const EvaluateConfig& config,
                                     const std::function<void(int done, int total)>& progress);

// The meshes of one frame as the scores take them; `matches` and `remarks` say how they were read.
// Errors: those of ReadMeshFolder and CheckUnits.
struct PreparedMeshes {
  SceneMeshes meshes;
  std::vector<PartMatch> matches;
  std::vector<std::string> remarks;
};
Expected<PreparedMeshes> PrepareMeshes(const SceneTruth& truth,
                                       const std::vector<ObjectInfo>& objects,
                                       const EvaluateConfig& config);

std::string EvaluateTable(const EvaluateResult& result);
nlohmann::json ToJson(const EvaluateResult& result);

}  // namespace tsdfpp
