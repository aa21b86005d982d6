#include "mapper/track/outline_term.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "mapper/volume/fusion_kernels.h"

namespace tsdfpp {
namespace {

// Surfaces seen flatter than this (cosine) may lie behind the outline's curve.
constexpr float kLeastFacing = 0.1F;
// The outline is half a pixel beside the segment's last pixel, and a pixel uncertain.
constexpr double kOutline_px = 1.5;

}  // namespace

SegmentOutline OutlineOf(const cv::Mat& labels, InstanceId id,
                         const std::vector<SegmentPoint>& points, const cv::Mat& depth,
                         const Intrinsics& camera, int margin_px) {
  SegmentOutline outline;
  outline.camera = camera;
  cv::Rect segment;
  for (const SegmentPoint& point : points) segment |= cv::Rect(point.pixel, cv::Size(1, 1));
  const cv::Rect wider(segment.x - margin_px, segment.y - margin_px, segment.width + 2 * margin_px,
                       segment.height + 2 * margin_px);
  outline.box = wider & cv::Rect(0, 0, labels.cols, labels.rows);
  const cv::Mat near = labels(outline.box);
  const cv::Mat beside = near != static_cast<double>(id);
  cv::distanceTransform(beside, outline.pixels, cv::DIST_L2, cv::DIST_MASK_PRECISE);
  outline.depth = depth(outline.box).clone();
  outline.depth.setTo(0, near == static_cast<double>(kNoInstance));
  return outline;
}

OutlineTerm::OutlineTerm(const std::vector<SurfacePlace>& places, const SegmentOutline& outline,
                         const MotionFrame& frame, const Options& options)
    : places_(&places),
      outline_(&outline),
      frame_(frame),
      options_(options),
      count_(std::min(places.size(), static_cast<std::size_t>(options.max_places))) {}

OutlineTerm::Miss OutlineTerm::MissOf(const Eigen::Vector3d& p_C,
                                      const Eigen::Vector3d& normal_C) const {
  if (!(p_C.z() > kNearest_m)) return {};
  if (!(-normal_C.dot(p_C) > kLeastFacing * p_C.norm())) return {};
  const Intrinsics& camera = outline_->camera;
  const double u = camera.fx * p_C.x() / p_C.z() + camera.cx - outline_->box.x;
  const double v = camera.fy * p_C.y() / p_C.z() + camera.cy - outline_->box.y;
  if (!(u >= 0 && v >= 0 && u < outline_->pixels.cols - 1 && v < outline_->pixels.rows - 1)) {
    return {};
  }
  const int x = static_cast<int>(u);
  const int y = static_cast<int>(v);
  const double fu = u - x;
  const double fv = v - y;
  const auto* above = outline_->pixels.ptr<float>(y) + x;
  const auto* below = outline_->pixels.ptr<float>(y + 1) + x;
  const double upper = above[0] + (above[1] - above[0]) * fu;
  const double lower = below[0] + (below[1] - below[0]) * fu;
  const double focal = std::sqrt(camera.fx * camera.fy);
  const double pixel_m = p_C.z() / focal;
  const double pixels = upper + (lower - upper) * fv - kOutline_px - options_.slack_m / pixel_m;
  if (!(pixels > 0)) return {};
  const auto seen_m =
      outline_->depth.at<float>(static_cast<int>(v + 0.5), static_cast<int>(u + 0.5));
  if (!IsValidDepth(seen_m) || p_C.z() > seen_m + options_.margin_m) return {};
  const double slope_u = (above[1] - above[0]) * (1 - fv) + (below[1] - below[0]) * fv;
  const double slope_v = lower - upper;
  // How the pixel moves with the place; that a pixel is wider farther off is left out.
  return {
      pixels * pixel_m,
      Eigen::Vector3d(slope_u * camera.fx, slope_v * camera.fy,
                      -(slope_u * camera.fx * p_C.x() + slope_v * camera.fy * p_C.y()) / p_C.z()) /
          focal};
}

NormalEquations OutlineTerm::Sums(const Pose& T_LC) const {
  NormalEquations sums;
  if (count_ == 0) return sums;
  const Pose T_CL = T_LC.inverse();
  const double weight = options_.weight / static_cast<double>(count_);
  const double huber_m = options_.huber_m;
  for (std::size_t i = 0; i < count_; ++i) {
    const SurfacePlace& place = (*places_)[i * places_->size() / count_];
    const Eigen::Vector3d y = place.p_L.cast<double>();
    const Miss miss = MissOf(T_CL * y, T_CL.linear() * place.normal_L.cast<double>());
    const double r = miss.distance_m;
    if (!(r > 0)) continue;
    // The motion is the points'; before them the model moves the other way.
    const Eigen::Vector3d n = -(T_LC.linear() * miss.slope_C);
    Vector6 J;
    J.head<3>() = n;
    J.tail<3>() = (y - frame_.centre).cross(n) / frame_.radius_m;
    const bool is_far = r > huber_m;
    sums.cost += weight * (is_far ? huber_m * (r - huber_m / 2) : r * r / 2);
    const Vector6 weighted = weight * (is_far ? huber_m / r : 1) * J;
    sums.g += weighted * r;
    sums.H.noalias() += weighted * J.transpose();
  }
  return sums;
}

}  // namespace tsdfpp
