// A TUM trajectory: lines "t tx ty tz qx qy qz qw", T_world_camera, t in seconds.
#pragma once

#include <filesystem>
#include <map>
#include <optional>

#include "core/error.h"
#include "core/types.h"

namespace tsdfpp {

// Poses further apart than this are not interpolated between: a gap in the recording.
inline constexpr double kLongestPoseGap_s = 0.1;
// How far from the first or last pose an image may be, and from its colour image a depth image:
// the limit of TUM's own associate.py.
inline constexpr double kAssociationLimit_s = 0.02;

using TimedPoses = std::map<double, Pose>;

// Errors: kData, with file and line: no time, no pose (PoseFromText), two poses at one time, no
// line at all.
Expected<TimedPoses> ReadTimedPoses(const std::filesystem::path& path);

// The pose at this very time, else interpolated between its neighbours (translation linearly,
// rotation by slerp) where they are kLongestPoseGap_s apart at most, else the nearest one within
// kAssociationLimit_s; nothing where there is none.
std::optional<Pose> PoseAt(const TimedPoses& poses, double time_s);

}  // namespace tsdfpp
