// Poses on disk in the layout of a Co-Fusion set (docs/sources.md, "Co-Fusion"):
// trajectories/gt-cam-0.txt and gt-<name>-<id>.txt, one line a frame, "frame tx ty tz qx qy qz qw".
// A scene rendered again from them needs no physics and no camera path.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/types.h"

namespace tsdfpp {

// All poses of a sequence, frame by frame; the first entries are those of frame 1.
struct PoseTable {
  std::vector<Pose> T_WC;
  std::map<InstanceId, std::vector<Pose>> T_WO;
};

// Writes gt-cam-0.txt and one file an object (the background has none). The poses that are read
// back are PoseThroughText of those given. Errors: kEnvironment where the disk refuses.
Expected<void> WritePoseFolder(const PoseTable& poses, const std::vector<ObjectInfo>& objects,
                               const std::filesystem::path& folder);

// Reads the poses of `frames` frames of the camera and of each object. Errors: kData, naming file
// and line: a file or frame is missing, a frame is there twice, a line is no pose.
Expected<PoseTable> ReadPoseFolder(const std::filesystem::path& folder,
                                   const std::vector<ObjectInfo>& objects, int frames);

struct TimedPose {
  double time_s = 0;
  Pose pose = Pose::Identity();
};

// A trajectory in TUM's format, "t tx ty tz qx qy qz qw", '#' comments; two poses at least.
// Errors: kData, naming file and line; times must increase.
Expected<std::vector<TimedPose>> ReadTumTrajectory(const std::filesystem::path& path);

// `part` of the way from a to b: positions linearly, rotations by slerp.
Pose Interpolate(const Pose& a, const Pose& b, double part);
// The pose at a fractional index; exactly poses[i] at a whole one, and the ends' beyond them.
Pose PoseAt(const std::vector<Pose>& poses, double index);

}  // namespace tsdfpp
