// All scores of one map at one frame (facts/metrics.md; docs/metrics.md).
#pragma once

#include <nlohmann/json.hpp>
#include <set>

#include "eval/scene_sanity.h"
#include "eval/scene_truth.h"
#include "mapper/map_representation.h"
#include "metrics/accuracy.h"
#include "metrics/preservation.h"

namespace tsdfpp {

inline constexpr std::array<double, 3> kThresholdsVoxels{0.5, 1, 2};

// What one run remembers between its evaluations: for retention.
using LastSeenStores = std::vector<LastSeenStore>;  // a tracker of SceneTruth
LastSeenStores MakeLastSeenStores(const SceneTruth& truth);

// Scores of one object (of the table, where it is the background) on the scene mesh after the other
// moving objects were removed; all but `visible_completion`, which is taken on the visible scene as
// it is.
struct ObjectScores {
  ObjectInfo info;
  PreservationScores preserved;  // at one voxel
  Measured visible_completion;   // of the visible scene, at one voxel
  AccuracyScores accuracy;       // precision at kThresholdsVoxels
  DistanceSummary completion;    // truth to reconstruction, seen samples
  std::array<Measured, 3> recall;
  std::array<Measured, 3> f_score;
  Measured label_purity;
};

struct Evaluation {
  int frame = 0;
  std::vector<ObjectScores> objects;  // background first
  Measured visible_completion;        // all regions and objects, by area
  double ghost_area_m2 = 0;           // of the visible scene, in observed free space
  Measured ghost_share;
  double revealed_ghost_area_m2 = 0;  // after all movers were removed
  SanityScores sanity;
  TriangleMesh scene;             // visible, nothing removed
  TriangleMesh revealed;          // after all movers were removed
  Selection table_reconstructed;  // of the background's samples, on `revealed`
  double mesh_s = 0;              // making `scene`
  double evaluate_s = 0;          // all the rest but the removals' copies and meshes
};

// `movers` are the objects that the experiment removes. `names` are the objects in the order of the
// trackers. The map is not changed: each removal acts on a copy.
Evaluation Evaluate(const MapRepresentation& map, const SceneTruth& truth,
                    const std::vector<ObjectInfo>& names, const std::set<InstanceId>& movers,
                    double voxel_m, LastSeenStores& last_seen);

// null, with a reason beside it, where a value is undefined.
nlohmann::json ToJson(const Measured& measured);
nlohmann::json ToJson(const Evaluation& evaluation);

}  // namespace tsdfpp
