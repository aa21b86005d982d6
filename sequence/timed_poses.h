// A TUM trajectory: lines "t tx ty tz qx qy qz qw", T_world_camera, t in seconds.
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/types.h"

namespace tsdfpp {

// Poses further apart than this are not interpolated between: a gap in the recording.
inline constexpr double kLongestPoseGap_s = 0.1;
// How far from the first or last pose an image may be, and from its colour image a depth image:
// the limit of TUM's own associate.py.
inline constexpr double kAssociationLimit_s = 0.02;

using TimedPoses = std::map<double, Pose>;

// A time may stand on several lines, as in TUM's own fr2/desk, and lines may go back in time: of a
// time the last line counts, and the order is that of the times. So TUM's tools have it
// (associate.py, evaluate_ate.py and evaluate_rpe.py keep a dictionary by time). `remarks`, where
// given, gets a sentence on either, with file, count and first line. Errors: kData, with file and
// line: no time, no pose (PoseFromText), no line at all.
Expected<TimedPoses> ReadTimedPoses(const std::filesystem::path& path,
                                    std::vector<std::string>* remarks = nullptr);

// The pose at this very time, else interpolated between its neighbours (translation linearly,
// rotation by slerp) where they are kLongestPoseGap_s apart at most, else the nearest one within
// kAssociationLimit_s; nothing where there is none.
std::optional<Pose> PoseAt(const TimedPoses& poses, double time_s);

// Where poses are read at another time than the images' (SequenceOptions::pose_offset_s), a
// sentence that says so. Errors: kUsage where there is an offset and no file of poses.
Expected<void> RemarkOnPoseOffset(const std::filesystem::path& path, double offset_s,
                                  std::vector<std::string>& remarks);

}  // namespace tsdfpp
