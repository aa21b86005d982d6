// Which pose of an estimated trajectory belongs to which true one.
#pragma once

#include <map>
#include <vector>

#include "core/types.h"
#include "metrics/trajectory.h"

namespace tsdfpp {

using StampedTrajectory = std::map<double, Pose>;  // T_world_body by time stamp, seconds

// Farther apart than this, two stamps are not one instant: evo's default.
inline constexpr double kMaxStampDifference_s = 0.01;

struct Association {
  PosePairs pairs;               // `frames` counts the estimate's poses, from 0
  std::vector<double> stamps_s;  // of the estimate, a pair
  // Poses of either that found no partner.
  std::size_t unmatched_estimate = 0;
  std::size_t unmatched_truth = 0;
};

// For each pose of the shorter trajectory (the estimate, where they are of one length) the nearest
// of the longer in time, where the two are at most `max_difference_s` apart; of two equally near
// the earlier. No pose is interpolated. That is evo's rule (evo.core.sync.associate_trajectories);
// a pose of the longer may serve twice. Both trajectories may be empty.
Association AssociateByTime(const StampedTrajectory& truth, const StampedTrajectory& estimate,
                            double max_difference_s = kMaxStampDifference_s);

// The iterator nearest in time; of two equally near the earlier. `trajectory` is not empty.
StampedTrajectory::const_iterator NearestInTime(const StampedTrajectory& trajectory,
                                                double stamp_s);

}  // namespace tsdfpp
