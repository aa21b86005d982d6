#include "mapper/methods/surfel_pixels.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "mapper/methods/surfel_list.h"

namespace tsdfpp {
namespace {

// A surface that falls off faster, a pixel, is another one behind an edge: 84 degrees. Pixels seen
// at a flatter angle stand for as much as at this one.
constexpr double kSteepest = 10;
constexpr double kLeastCosine = 1 / kSteepest;
// Pixels between the ends of a difference at most: half.
constexpr int kMostStep = 8;
// Where the steps to both sides differ by more depth, the surface bends there.
constexpr double kBend_voxels = 0.5;
constexpr int kRowsPerTask = 16;

}  // namespace

SurfelPixels::SurfelPixels(const Frame& frame, const cv::Mat& labels, double voxel_m)
    : frame_(&frame),
      labels_(labels),
      camera_(frame.intrinsics),
      rays_(frame.intrinsics),
      voxel_m_(voxel_m),
      focal_(std::min(camera_.fx, camera_.fy)),
      normals_(static_cast<std::size_t>(camera_.width) * static_cast<std::size_t>(camera_.height),
               Eigen::Vector3f::Zero()) {
  tbb::parallel_for(
      tbb::blocked_range<int>(0, camera_.height, kRowsPerTask),
      [&](const tbb::blocked_range<int>& rows) {
        auto* normal = normals_.data() + static_cast<std::size_t>(rows.begin()) *
                                             static_cast<std::size_t>(camera_.width);
        for (int v = rows.begin(); v < rows.end(); ++v) {
          for (int u = 0; u < camera_.width; ++u) *normal++ = FindNormal(u, v);
        }
      },
      tbb::simple_partitioner());
}

bool SurfelPixels::GoesOn(int u, int v, int to_u, int to_v, int pixels) const {
  if (to_u < 0 || to_u >= camera_.width || to_v < 0 || to_v >= camera_.height) return false;
  const float z = frame_->depth.at<float>(v, u);
  const float to_z = frame_->depth.at<float>(to_v, to_u);
  if (!IsValidDepth(to_z) || labels_.at<InstanceId>(to_v, to_u) != labels_.at<InstanceId>(v, u)) {
    return false;
  }
  return std::abs(static_cast<double>(to_z) - static_cast<double>(z)) <=
         kSteepest * pixels * Footprint(static_cast<double>(z));
}

Eigen::Vector3d SurfelPixels::StepAlong(int u, int v, int axis) const {
  const auto point = [&](int at_u, int at_v) {
    return PointAt(static_cast<std::size_t>(at_u), static_cast<std::size_t>(at_v));
  };
  const Eigen::Vector3d here = point(u, v);
  const double spacing_m = kSurfelSpacing_voxels * voxel_m_;
  int step = static_cast<int>(
      std::clamp(std::floor(spacing_m / Footprint(here.z())), 1.0, double{kMostStep}));
  for (; step >= 1; step /= 2) {
    const int du = axis == 0 ? step : 0;
    const int dv = axis == 0 ? 0 : step;
    const bool on = GoesOn(u, v, u + du, v + dv, step);
    const bool back = GoesOn(u, v, u - du, v - dv, step);
    if (!on && !back) continue;
    const Eigen::Vector3d to_next =
        on ? Eigen::Vector3d(point(u + du, v + dv) - here) : Eigen::Vector3d::Zero();
    const Eigen::Vector3d from_last =
        back ? Eigen::Vector3d(here - point(u - du, v - dv)) : Eigen::Vector3d::Zero();
    if (!back) return to_next;
    if (!on) return from_last;
    if (std::abs(to_next.z() - from_last.z()) <= kBend_voxels * voxel_m_) {
      return to_next + from_last;
    }
    return std::abs(to_next.z()) <= std::abs(from_last.z()) ? to_next : from_last;
  }
  return Eigen::Vector3d::Zero();
}

Eigen::Vector3f SurfelPixels::FindNormal(int u, int v) const {
  const auto at_u = static_cast<std::size_t>(u);
  const auto at_v = static_cast<std::size_t>(v);
  if (!IsUsable(at_u, at_v) || static_cast<double>(depth(at_u, at_v)) < kNearestSeen_m) {
    return Eigen::Vector3f::Zero();
  }
  const Eigen::Vector3d right = StepAlong(u, v, 0);
  const Eigen::Vector3d down = StepAlong(u, v, 1);
  const Eigen::Vector3d normal = down.cross(right);
  const double length = normal.norm();
  if (!(length > 0) || !(normal.dot(rays_.At(at_u, at_v)) < 0)) return Eigen::Vector3f::Zero();
  return (normal / length).cast<float>();
}

double SurfelPixels::Reach(double depth_m) const {
  return std::max(kSurfelSpacing_voxels * voxel_m_, kSurfelSpacing_pixels * Footprint(depth_m));
}

double SurfelPixels::RadiusAt(std::size_t u, std::size_t v) const {
  const Eigen::Vector3d ray = rays_.At(u, v);
  const auto z = static_cast<double>(depth(u, v));
  const double cosine = -normal(u, v).cast<double>().dot(ray) / ray.norm();
  const double extent = Footprint(z) / (std::numbers::sqrt2 * std::max(cosine, kLeastCosine));
  return std::min(Reach(z) + extent, kMostSurfelRadius_voxels * voxel_m_);
}

}  // namespace tsdfpp
