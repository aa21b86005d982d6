#include "mapper/track/motion_uncertainty.h"

#include <Eigen/Geometry>

namespace tsdfpp {

Matrix6 CovarianceIn(const MotionFrame& to, const MotionFrame& from, const Matrix6& covariance_m2) {
  // With turns w = t / r: the other centre shifts by w x (to - from) more.
  const Eigen::Vector3d way = to.centre - from.centre;
  Matrix6 change = Matrix6::Identity();
  for (int axis = 0; axis < 3; ++axis) {
    change.block<3, 1>(0, 3 + axis) = Eigen::Vector3d::Unit(axis).cross(way) / from.radius_m;
  }
  change.bottomRightCorner<3, 3>() *= to.radius_m / from.radius_m;
  return change * covariance_m2 * change.transpose();
}

MotionUncertainty UncertaintyOfMotion(const PlaceUncertainty& before, const PlaceUncertainty& after,
                                      const Eigen::Matrix3d& R_WL,
                                      const Eigen::Vector3d& centre_W) {
  const Matrix6 sum_L =
      after.covariance_m2 + CovarianceIn(after.frame_L, before.frame_L, before.covariance_m2);
  Matrix6 axes = Matrix6::Zero();
  axes.topLeftCorner<3, 3>() = R_WL;
  axes.bottomRightCorner<3, 3>() = R_WL;
  MotionUncertainty motion{0, {centre_W, after.frame_L.radius_m}, {}, 0};
  motion.covariance_m2 = axes * sum_L * axes.transpose();
  return motion;
}

}  // namespace tsdfpp
