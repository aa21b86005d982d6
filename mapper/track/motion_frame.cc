#include "mapper/track/motion_frame.h"

#include <Eigen/Geometry>

namespace tsdfpp {

Pose MotionFrame::MotionOf(const Vector6& x) const {
  const Eigen::Vector3d turn = x.tail<3>() / radius_m;
  const double angle = turn.norm();
  Pose motion = Pose::Identity();
  if (angle > 0) {
    // Through a quaternion, whose matrix is a rotation to rounding.
    motion.linear() =
        Eigen::Quaterniond(Eigen::AngleAxisd(angle, turn / angle)).normalized().toRotationMatrix();
  }
  motion.translation() = centre - motion.linear() * centre + x.head<3>();
  return motion;
}

Vector6 MotionFrame::LengthsOf(const Pose& motion) const {
  const Eigen::AngleAxisd turn(motion.linear());
  Vector6 x;
  x.head<3>() = motion * centre - centre;
  x.tail<3>() = turn.angle() * radius_m * turn.axis();
  return x;
}

double MotionFrame::LongestWay_m(const Pose& motion) const {
  const Vector6 way = LengthsOf(motion);
  return way.head<3>().norm() + 2 * way.tail<3>().norm();
}

}  // namespace tsdfpp
