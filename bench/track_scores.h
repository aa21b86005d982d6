// How well one object was tracked in one run (docs/tracking.md).
#pragma once

#include <cstddef>
#include <map>
#include <set>
#include <vector>

#include "core/types.h"
#include "mapper/track/motion_uncertainty.h"
#include "metrics/measured.h"
#include "metrics/trajectory.h"

namespace tsdfpp {

struct TrackedObject {
  Trajectory T_WO_estimate;
  Trajectory T_WO_truth;
  std::set<int> shown;                         // the frames that show enough of it
  std::vector<Eigen::Vector3f> points_O;       // of its true surface
  std::map<int, MotionUncertainty> motions{};  // as the tracker knows them, by frame
};

// Motions of less are not judged: an object at rest is left where it is, without an error.
inline constexpr double kLeastMotion_m = 0.0005;

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
  // Over the motions that move a point by at least kLeastMotion_m: the mean of the squared error of
  // the six lengths in units of the covariance, a direction that is not free. 1 is honest.
  Measured nees;
  double free_directions = 0;  // of these motions, the mean
};

// Over the frames that show the object, and for which there is an estimate and the truth: what is
// hidden cannot be tracked. The estimate is anchored once, at the first of these
// (AnchoredAtFirst); shifts are those of the middle of the object's points, which a turn about that
// middle leaves 0. There must be one such frame and one point at least.
TrackScores ScoreTracked(const TrackedObject& object);

// Points of a true surface, for ADD and ADD-S, which is quadratic: 500, or what it has of samples.
std::vector<Eigen::Vector3f> SomePoints(const TriangleMesh& mesh);

}  // namespace tsdfpp
