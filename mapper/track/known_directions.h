// Along which directions terms know where an object is, and how well.
#pragma once

#include <algorithm>

#include "mapper/track/motion_frame.h"

namespace tsdfpp {

// How much is known along which directions, as shares of the points' weights, increasing, with the
// directions as columns. Of turns what the terms know while any shift is free (the Schur
// complement of the shifts): a ball tells no turn about its centre, whatever point `frame` turns it
// about. Of shifts what they know of an object that does not turn. So whatever motion the terms do
// not see has a part in one of the two.
struct KnownDirections {
  Eigen::Vector3d shift_shares = Eigen::Vector3d::Zero();
  Eigen::Matrix3d shifts = Eigen::Matrix3d::Identity();
  Eigen::Vector3d turn_shares = Eigen::Vector3d::Zero();
  Eigen::Matrix3d turns = Eigen::Matrix3d::Identity();

  double LeastShare() const { return std::min(shift_shares[0], turn_shares[0]); }
  // Directions whose share is less.
  int CountBelow(double share) const {
    return static_cast<int>((shift_shares.array() < share).count() +
                            (turn_shares.array() < share).count());
  }
};
// `information` is over the six lengths of a MotionFrame, in points; where it is not finite, or
// nothing of shifts is known, all shares are 0.
KnownDirections DirectionsOf(const Matrix6& information);

// What other terms know along those directions, in points.
struct AlongDirections {
  Eigen::Vector3d shifts = Eigen::Vector3d::Zero();
  Eigen::Vector3d turns = Eigen::Vector3d::Zero();
};
// `known` are the directions of `information`, of the distances. Of shifts it is what the others
// know where nothing turns, of turns what they add to what the distances know. Zero where numbers
// are not finite.
AlongDirections Along(const KnownDirections& known, const Matrix6& information,
                      const Matrix6& of_others);

}  // namespace tsdfpp
