#include "metrics/object_pose.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace tsdfpp {
namespace {

const char* const kNoPoints = "the model has no points";

// The smallest of `worst(symmetry)` over the identity and the symmetries.
template <typename Worst>
double LeastOverSymmetries(std::span<const Pose> symmetries, const Worst& worst) {
  double least = worst(Pose::Identity());
  for (const Pose& symmetry : symmetries) least = std::min(least, worst(symmetry));
  return least;
}

}  // namespace

Measured AddError_m(std::span<const Eigen::Vector3f> points_O, const Pose& T_WO_estimate,
                    const Pose& T_WO_truth) {
  if (points_O.empty()) return Measured::Undefined(kNoPoints);
  double sum = 0;
  for (const Eigen::Vector3f& point : points_O) {
    const Eigen::Vector3d p_O = point.cast<double>();
    sum += (T_WO_estimate * p_O - T_WO_truth * p_O).norm();
  }
  return Measured::Of(sum / static_cast<double>(points_O.size()));
}

Measured AddSymmetricError_m(std::span<const Eigen::Vector3f> points_O, const Pose& T_WO_estimate,
                             const Pose& T_WO_truth) {
  if (points_O.empty()) return Measured::Undefined(kNoPoints);
  // In the estimate's object frame, where the numbers are small enough for single precision.
  const Pose T_estimate_truth = T_WO_estimate.inverse() * T_WO_truth;
  std::vector<double> nearest(points_O.size());
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, points_O.size(), 64),
                    [&](const auto& range) {
                      for (std::size_t i = range.begin(); i < range.end(); ++i) {
                        const Eigen::Vector3f moved =
                            (T_estimate_truth * points_O[i].cast<double>()).template cast<float>();
                        float smallest = std::numeric_limits<float>::infinity();
                        for (const Eigen::Vector3f& point : points_O) {
                          smallest = std::min(smallest, (moved - point).squaredNorm());
                        }
                        nearest[i] = std::sqrt(static_cast<double>(smallest));
                      }
                    });
  const double sum = std::accumulate(nearest.begin(), nearest.end(), 0.0);
  return Measured::Of(sum / static_cast<double>(points_O.size()));
}

Measured Mssd_m(std::span<const Eigen::Vector3f> points_O, const Pose& T_WO_estimate,
                const Pose& T_WO_truth, std::span<const Pose> symmetries) {
  if (points_O.empty()) return Measured::Undefined(kNoPoints);
  return Measured::Of(LeastOverSymmetries(symmetries, [&](const Pose& symmetry) {
    const Pose turned = T_WO_truth * symmetry;
    double worst = 0;
    for (const Eigen::Vector3f& point : points_O) {
      const Eigen::Vector3d p_O = point.cast<double>();
      worst = std::max(worst, (T_WO_estimate * p_O - turned * p_O).norm());
    }
    return worst;
  }));
}

Measured Mspd_px(std::span<const Eigen::Vector3f> points_O, const Pose& T_CO_estimate,
                 const Pose& T_CO_truth, const Intrinsics& camera,
                 std::span<const Pose> symmetries) {
  if (points_O.empty()) return Measured::Undefined(kNoPoints);
  bool behind = false;
  const auto project = [&](const Eigen::Vector3d& p_C) {
    behind = behind || !(p_C.z() > 0);
    return Eigen::Vector2d(camera.fx * p_C.x() / p_C.z() + camera.cx,
                           camera.fy * p_C.y() / p_C.z() + camera.cy);
  };
  const double error = LeastOverSymmetries(symmetries, [&](const Pose& symmetry) {
    const Pose turned = T_CO_truth * symmetry;
    double worst = 0;
    for (const Eigen::Vector3f& point : points_O) {
      const Eigen::Vector3d p_O = point.cast<double>();
      worst = std::max(worst, (project(T_CO_estimate * p_O) - project(turned * p_O)).norm());
    }
    return worst;
  });
  if (behind) return Measured::Undefined("a point of the model lies behind the camera");
  return Measured::Of(error);
}

Measured AreaUnderCurve(std::span<const Measured> errors, double greatest) {
  if (errors.empty()) return Measured::Undefined("there are no poses");
  double sum = 0;
  for (const Measured& error : errors) {
    if (error.value) sum += std::max(0.0, 1 - *error.value / greatest);
  }
  return Measured::Of(sum / static_cast<double>(errors.size()));
}

}  // namespace tsdfpp
