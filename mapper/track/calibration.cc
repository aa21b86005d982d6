#include "mapper/track/calibration.h"

namespace tsdfpp {
namespace {

// Along a direction of which less than this share of its points speaks a segment does not know
// where it is, and corrects nothing.
constexpr double kLeastShare = 0.02;

// `far`'s part along each direction of the place found, by what it and the far segment know.
Eigen::Vector3d Part(const Eigen::Vector3d& near, const Eigen::Vector3d& far,
                     const Eigen::Matrix3d& directions, const Eigen::Vector3d& shares,
                     const Eigen::Matrix3d& directions_far, const Eigen::Vector3d& shares_far) {
  const Eigen::Matrix3d cosines = directions_far.transpose() * directions;
  const Eigen::Array3d by_far = (cosines.cwiseAbs2().transpose() * shares_far).array();
  const Eigen::Array3d least = by_far.max(kLeastShare);
  const Eigen::Vector3d trust = (shares.array() / least).min(1) * (by_far / kLeastShare).min(1);
  return near + directions * trust.asDiagonal() * directions.transpose() * (far - near);
}

}  // namespace

Pose Joined(const Calibration& near, const Calibration& far, const SdfRegistrationResult& found) {
  const Vector6 by_near = found.frame.LengthsOf(near.correction_L);
  const Vector6 by_far = found.frame.LengthsOf(far.correction_L);
  const KnownDirections& known = found.known;
  Vector6 joined;
  joined.head<3>() = Part(by_near.head<3>(), by_far.head<3>(), known.shifts, known.shift_shares,
                          far.known.shifts, far.known.shift_shares);
  joined.tail<3>() = Part(by_near.tail<3>(), by_far.tail<3>(), known.turns, known.turn_shares,
                          far.known.turns, far.known.turn_shares);
  return found.frame.MotionOf(joined);
}

}  // namespace tsdfpp
