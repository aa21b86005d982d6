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
// To each side, of the differences that normals are made of.
constexpr double kNormalStep_voxels = 0.5;
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

float SurfelPixels::DepthWhereItGoesOn(int u, int v, int to_u, int to_v, double most_m) const {
  if (to_u < 0 || to_u >= camera_.width || to_v < 0 || to_v >= camera_.height) return 0;
  const float z = frame_->depth.at<float>(v, u);
  const float to_z = frame_->depth.at<float>(to_v, to_u);
  const bool goes_on = IsValidDepth(to_z) &&
                       labels_.at<InstanceId>(to_v, to_u) == labels_.at<InstanceId>(v, u) &&
                       std::abs(static_cast<double>(to_z) - static_cast<double>(z)) <= most_m;
  return goes_on ? to_z : 0;
}

Eigen::Vector3d SurfelPixels::StepAlong(int u, int v, int axis) const {
  const auto ray = [&](int at_u, int at_v) {
    return rays_.At(static_cast<std::size_t>(at_u), static_cast<std::size_t>(at_v));
  };
  const auto z = static_cast<double>(frame_->depth.at<float>(v, u));
  const double footprint_m = Footprint(z);
  int step = static_cast<int>(
      std::clamp(std::floor(kNormalStep_voxels * voxel_m_ / footprint_m), 1.0, double{kMostStep}));
  for (; step >= 1; step /= 2) {
    const int du = axis == 0 ? step : 0;
    const int dv = axis == 0 ? 0 : step;
    const double most_m = kSteepest * step * footprint_m;
    const auto on = static_cast<double>(DepthWhereItGoesOn(u, v, u + du, v + dv, most_m));
    const auto back = static_cast<double>(DepthWhereItGoesOn(u, v, u - du, v - dv, most_m));
    if (on == 0 && back == 0) continue;
    const double falls_on = on - z;
    const double falls_back = z - back;
    const bool bends = std::abs(falls_on - falls_back) > kBend_voxels * voxel_m_;
    const bool takes_on =
        on != 0 && (back == 0 || !bends || std::abs(falls_on) <= std::abs(falls_back));
    const bool takes_back = back != 0 && (on == 0 || !bends || !takes_on);
    const Eigen::Vector3d here = z * ray(u, v);
    const Eigen::Vector3d end = takes_on ? Eigen::Vector3d(on * ray(u + du, v + dv)) : here;
    const Eigen::Vector3d begin = takes_back ? Eigen::Vector3d(back * ray(u - du, v - dv)) : here;
    return end - begin;
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
