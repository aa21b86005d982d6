// How well one object was tracked in one run (docs/tracking.md).
#pragma once

#include <cstddef>
#include <set>
#include <vector>

#include "metrics/measured.h"
#include "metrics/trajectory.h"

namespace tsdfpp {

struct TrackedObject {
  Trajectory T_WO_estimate;
  Trajectory T_WO_truth;
  std::set<int> shown;                    // the frames that show enough of it
  std::vector<Eigen::Vector3f> points_O;  // of its true surface
};

struct TrackScores {
  double moved_m = 0;      // the farthest that one of its points comes from where it began
  std::size_t frames = 0;  // that show it and have an estimate
  ObjectTrajectoryScores trajectory;  // anchored at the first of them
  double farthest_m = 0;              // the largest shift among them
  double end_m = 0;                   // that at the last of them
  Measured add_m;                     // means over them, of ADD and ADD-S
  Measured add_s_m;
  Measured within_5mm;  // shares of them, by ADD-S
  Measured within_2cm;
};

// Over the frames that show the object, and for which there is an estimate and the truth: what is
// hidden cannot be tracked. The estimate is anchored once, at the first of these
// (AnchoredAtFirst); shifts are those of the middle of the object's points, which a turn about that
// middle leaves 0. There must be one such frame and one point at least.
TrackScores ScoreTracked(const TrackedObject& object);

}  // namespace tsdfpp
