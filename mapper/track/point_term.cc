#include "mapper/track/point_term.h"

#include <algorithm>
#include <cmath>

#include "core/robust_deviation.h"

namespace tsdfpp {
namespace {

// Of deviations: further errors count linearly.
constexpr double kHuber_deviations = 1.5;
// Those that are so many times as far off say nothing of where the point is.
constexpr double kFarthest_hubers = 10;

}  // namespace

void PointTerm::KeepAt(const Pose& T_LC, double distance_m) {
  Prepare(T_LC);
  kept_.clear();
  distance_m_ = distance_m;
  const Pose T_CL = T_LC.inverse();
  std::vector<float> sizes;
  for (std::size_t i = 0; i < points_L_.size(); ++i) {
    const Eigen::Vector3d p_C = T_CL * points_L_[i];
    const PointSight sight = At(i, p_C);
    if (!sight.is_seen || !IsFit(i, p_C)) continue;
    kept_.push_back({i, sight.r});
    sizes.push_back(static_cast<float>(std::abs(sight.r)));
  }
  deviation_ = std::max(RobustDeviation(std::move(sizes)), LeastDeviation(distance_m));
}

Matrix6 PointTerm::Information(const Pose& T_LC, const MotionFrame& frame) const {
  const double at_best = LeastDeviation(distance_m_);
  return Sums(T_LC, frame).H * (deviation_ * deviation_ / (at_best * at_best));
}

NormalEquations PointTerm::Sums(const Pose& T_LC, const MotionFrame& frame) const {
  NormalEquations sums;
  const Pose T_CL = T_LC.inverse();
  const double huber = kHuber_deviations * deviation_;
  const double farthest = kFarthest_hubers * huber;
  const double scale = weight_ * distance_m_ * distance_m_ / (deviation_ * deviation_);
  for (const Kept& kept : kept_) {
    const Eigen::Vector3d& p_L = points_L_[kept.point];
    const PointSight sight = At(kept.point, T_CL * p_L);
    const double r = sight.is_seen ? sight.r : kept.r;
    const double size = std::min(std::abs(r), farthest);
    const bool is_far = size > huber;
    sums.cost += scale * (is_far ? huber * (size - huber / 2) : r * r / 2);
    if (!sight.is_seen || size >= farthest) continue;
    // A motion of the object in its lattice is one of the camera the other way.
    const Eigen::Vector3d slope_L = T_LC.linear() * sight.slope_C;
    const Eigen::Vector3d arm = (p_L - frame.centre) / frame.radius_m;
    Vector6 J;
    J << -slope_L, -arm.cross(slope_L);
    const double weight = scale * (is_far ? huber / size : 1);
    sums.H += weight * J * J.transpose();
    sums.g += weight * r * J;
  }
  return sums;
}

}  // namespace tsdfpp
