// A small motion of an object as six lengths.
#pragma once

#include <Eigen/Core>

#include "core/types.h"

namespace tsdfpp {

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

// A small motion of the object's points y about `centre`, as six lengths: they are shifted by
// x[0..2] and turned by x[3..5] / radius (a rotation vector), so that one number means about as
// much way at the object's surface wherever it stands in x.
struct MotionFrame {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  double radius_m = 1;

  // y -> centre + exp(x[3..5] / radius) (y - centre) + x[0..2].
  Pose MotionOf(const Vector6& x) const;
  // The inverse of MotionOf, for turns of less than pi.
  Vector6 LengthsOf(const Pose& motion) const;
  // How far the motion takes a point at most: points lie up to some two radii from the centre.
  double LongestWay_m(const Pose& motion) const;
};

}  // namespace tsdfpp
