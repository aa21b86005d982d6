// All scores of one map at one frame (docs/sources.md, "Metrics"; docs/metrics.md).
#pragma once

#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "eval/score/scene_sanity.h"
#include "eval/score/scene_seams.h"
#include "eval/truth/scene_truth.h"
#include "mapper/scene_mesher.h"
#include "metrics/accuracy.h"
#include "metrics/preservation.h"
#include "metrics/trajectory.h"

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

// The meshes that one evaluation looks at, in the world's frame.
struct SceneMeshes {
  TriangleMesh scene;  // visible, nothing removed
  // The visible scene after these objects were removed; see RemovalsOf.
  std::map<std::set<InstanceId>, TriangleMesh> without;
  // Do faces carry ids? Where they do not, nothing can be removed, and every score takes faces of
  // any label: the label-agnostic score.
  bool labelled = true;
  double mesh_s = 0;  // making `scene`

  // `scene` where nothing is removed or nothing can be.
  const TriangleMesh& Without(const std::set<InstanceId>& removed) const;
};

// The removals that an evaluation looks at: all `movers`, and for each of them all the others.
std::set<std::set<InstanceId>> RemovalsOf(const std::set<InstanceId>& movers);

struct Evaluation {
  int frame = 0;
  bool labelled = true;               // as SceneMeshes; else purity and ghosts after are undefined
  std::vector<ObjectScores> objects;  // background first, where the truth has one
  Measured visible_completion;        // all regions and objects, by area
  double ghost_area_m2 = 0;           // of the visible scene, in observed free space
  double ghost_error_m2 = 0;          // its standard error, of sampling alone; so below
  Measured ghost_share;
  // After all movers were removed, in space known to be free: seen so, or where a mover was.
  Measured revealed_ghost_area_m2;
  Measured revealed_ghost_error_m2;
  // The same in space that nobody has seen to be free.
  Measured revealed_unseen_area_m2;
  Measured revealed_unseen_error_m2;
  SanityScores sanity;
  SeamScores seams;
  TriangleMesh scene;             // visible, nothing removed
  TriangleMesh revealed;          // after all movers were removed
  Selection table_reconstructed;  // of the background's samples, on `revealed`
  double mesh_s = 0;              // making `scene`
  double evaluate_s = 0;          // all the rest but the removals' copies and meshes
};

// Where no true background is known (others' sets have models of objects alone) there are no
// figures of the table, and none of ghosts: what lies on the true table is no ghost.
inline constexpr const char* kNoTrueBackground = "no true background is known";
inline bool KnowsBackground(const Evaluation& evaluation) {
  return !evaluation.objects.empty() && evaluation.objects.front().info.id == kBackground;
}

// `movers` are the objects that the experiment removes; `meshes` has all of RemovalsOf(movers) that
// are not empty. `names` are the objects in the order of the trackers. `mesh_s` stays 0.
Evaluation EvaluateMeshes(SceneMeshes meshes, const SceneTruth& truth,
                          const std::vector<ObjectInfo>& names, const std::set<InstanceId>& movers,
                          double voxel_m, LastSeenStores& last_seen);

// What the map's visible scene is before and after the removals, each of which acts on a copy.
// `mesher` keeps what it may from one evaluation of a map to the next.
SceneMeshes MeshesOf(const MapRepresentation& map, const std::set<InstanceId>& movers,
                     SceneMesher& mesher);

// EvaluateMeshes of MeshesOf, for one evaluation alone.
Evaluation Evaluate(const MapRepresentation& map, const SceneTruth& truth,
                    const std::vector<ObjectInfo>& names, const std::set<InstanceId>& movers,
                    double voxel_m, LastSeenStores& last_seen);

// null, with a reason beside it, where a value is undefined.
nlohmann::json ToJson(const Measured& measured);
nlohmann::json ToJson(const Evaluation& evaluation);
nlohmann::json ToJson(const ObjectTrajectoryScores& scores);

}  // namespace tsdfpp
