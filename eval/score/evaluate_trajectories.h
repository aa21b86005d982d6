// Scores the trajectories that any mapper wrote (docs/evaluate.md).
#pragma once

#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "core/error.h"
#include "eval/score/mesh_matching.h"
#include "metrics/trajectory.h"

namespace tsdfpp {

struct TrajectoryEvaluation {
  std::map<InstanceId, ObjectTrajectoryScores> objects;
  // Of the camera where the folder has one, nothing aligned, over the common frames.
  std::size_t camera_frames = 0;
  std::optional<ErrorSummary> camera_m;
  std::optional<ErrorSummary> camera_deg;
  std::vector<std::string> remarks;
};

// Files `<name>-<id>.txt`, `<name>.txt`, `<id>.txt` or `poses-<id>.txt` of lines "frame tx ty tz qx
// qy qz qw" (T_world_object), and `camera.txt` (T_world_camera). Names and ids are those of the
// parts in `matches` where one is called so, else the sequence's. The camera is taken as the true
// one where the folder has none. `truth` and `camera` are followed up to the last frame.
// Errors: kUsage where there is no such folder; kData where it has no trajectory, one cannot be
// read, two are of one object, or one has no frame in common with the truth.
Expected<TrajectoryEvaluation> EvaluateTrajectories(const std::filesystem::path& folder,
                                                    const std::vector<ObjectInfo>& objects,
                                                    const std::vector<PartMatch>& matches,
                                                    const std::map<InstanceId, Trajectory>& truth,
                                                    const Trajectory& camera);

nlohmann::json ToJson(const TrajectoryEvaluation& evaluation);

}  // namespace tsdfpp
