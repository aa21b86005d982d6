// A Co-Fusion trajectory: lines "frame tx ty tz qx qy qz qw", '#' comments.
#pragma once

#include <filesystem>
#include <map>
#include <string>

#include "core/error.h"
#include "core/types.h"

namespace tsdfpp {

// T_world_source by the frame's number.
using Trajectory = std::map<int, Pose>;

// `what` is the source of T_world_source, for the comment line, e.g. "camera".
std::string TrajectoryToText(const Trajectory& trajectory, const std::string& what);

// Errors: kData, with file and line: no frame number, no pose (PoseFromText), a frame twice.
Expected<Trajectory> ReadTrajectory(const std::filesystem::path& path);

}  // namespace tsdfpp
