// Whether the poses of a recording are those of its images' times.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/frame_source.h"
#include "metrics/trajectory.h"
#include "sequence/timed_poses.h"

namespace tsdfpp {

// How far the motions from each frame to the next are from others: degrees and millimetres, RMSE
// over the pairs of frames.
struct MotionErrors {
  double offset_s = 0;  // timed poses are read that much after the frames' times
  double turn_deg = 0;
  double shift_mm = 0;
};

// Between two trajectories of the camera, over the frames that both have; zeros where there are
// fewer than two.
MotionErrors MotionErrorsBetween(const Trajectory& T_WC, const Trajectory& T_WC_other);

// Between a trajectory and timed poses; the frames' times in seconds by frame. A frame at whose
// time there is no pose (PoseAt) is left out.
MotionErrors MotionErrorsAt(double offset_s, const Trajectory& T_WC,
                            const std::map<int, double>& times_s, const TimedPoses& poses);

// Those of the offset, of -80 to 80 ms in steps of 5, whose turns are the least off.
MotionErrors AtBestOffset(const Trajectory& T_WC, const std::map<int, double>& times_s,
                          const TimedPoses& poses);

struct FoundCamera {
  std::string who;
  Trajectory T_WC;
};

// Writes clock.csv into `out`: of each found trajectory, and of what Open3D's ICP makes of each
// frame and the next (it begins at the recording's own motions), how far its motions are from those
// of groundtruth.txt as stamped, and at the offset that fits best; how far its places are from
// those of groundtruth.txt at that offset after alignment (Horn), the RMSE that TUM's
// evaluate_ate.py gives; how far its turns are from Open3D's; and how far the frames' depth is from
// a map of voxels of 1 cm that was made with these poses, the median over their pixels. The last
// two also of groundtruth.txt itself, as stamped, at the offset that fits Open3D's motions best,
// and so with `other_camera` in place of the frames'. `source`'s poses are those of the images'
// times. `until`: the last frame. Errors: the recording's, kData where depth.txt has no image with
// the first frame's pose; kEnvironment where `out` cannot be written.
Expected<void> JudgeClock(const std::string& recording, FrameSource& source,
                          const Intrinsics& other_camera, int until, std::vector<FoundCamera> found,
                          const std::string& out);

}  // namespace tsdfpp
