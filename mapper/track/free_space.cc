#include "mapper/track/free_space.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "mapper/volume/fusion_kernels.h"

namespace tsdfpp {
namespace {

// Surfaces seen flatter than this (cosine) show their outline more than their place.
constexpr float kLeastFacing = 0.3F;
// Pixels around a place on each side, at most: a model that fills the image is not looked at
// longer.
constexpr int kMaxAround_px = 8;

// The least depth of the pixels around; nothing where one of them has none.
float LeastDepthAround(const cv::Mat& depth, int u, int v, int around) {
  float least = std::numeric_limits<float>::infinity();
  for (int y = v - around; y <= v + around; ++y) {
    const auto* row = depth.ptr<float>(y);
    for (int x = u - around; x <= u + around; ++x) {
      if (!IsValidDepth(row[x])) return std::numeric_limits<float>::quiet_NaN();
      least = std::min(least, row[x]);
    }
  }
  return least;
}

}  // namespace

std::vector<SurfacePlace> PlacesOf(const TsdfGrid& grid, const SurfaceReader& reader,
                                   double voxel_m) {
  std::vector<SurfacePlace> places;
  const auto reach_m = static_cast<float>(kPlaceReach_voxels * voxel_m);
  for (const auto& entry : grid.entries()) {
    if (!entry.block->AnyNegative()) continue;
    for (int place = 0; place < kBlockVoxels; ++place) {
      if (!Bit(entry.block->observed, place)) continue;
      // Distances along rays are never shorter than those to the surface.
      const float distance = entry.block->distance[static_cast<std::size_t>(place)];
      if (!(std::abs(distance) < 4 * reach_m)) continue;
      const Index3 voxel = VoxelAt(entry.index, place);
      const Eigen::Vector3d p_L = voxel_m * Eigen::Vector3d(voxel.x, voxel.y, voxel.z);
      const SurfaceSample sample = reader.At(p_L);
      if (!sample.has_slope || !(std::abs(sample.distance_m) < reach_m)) continue;
      places.push_back({p_L.cast<float>() - sample.distance_m * sample.normal_L, sample.normal_L});
    }
  }
  return places;
}

FreeSpaceCounts CountInFront(const std::vector<SurfacePlace>& places, const Pose& T_LC,
                             const cv::Mat& depth, const Intrinsics& camera, double voxel_m,
                             double margin_m, int max_places) {
  FreeSpaceCounts counts;
  const Eigen::Isometry3f T_CL = T_LC.inverse().cast<float>();
  const std::size_t count = std::min(places.size(), static_cast<std::size_t>(max_places));
  for (std::size_t i = 0; i < count; ++i) {
    const SurfacePlace& place = places[i * places.size() / count];
    const Eigen::Vector3f p_C = T_CL * place.p_L;
    if (!(p_C.z() > kNearest_m)) continue;
    const Eigen::Vector3f normal_C = T_CL.linear() * place.normal_L;
    if (!(-normal_C.dot(p_C) > kLeastFacing * p_C.norm())) continue;
    const double pixels = camera.fx * voxel_m / p_C.z() / 2;
    const int around = std::clamp(static_cast<int>(std::ceil(pixels)), 1, kMaxAround_px);
    const double u = std::round(camera.fx * p_C.x() / p_C.z() + camera.cx);
    const double v = std::round(camera.fy * p_C.y() / p_C.z() + camera.cy);
    if (!(u >= around && v >= around && u < depth.cols - around && v < depth.rows - around))
      continue;
    const float seen_m = LeastDepthAround(depth, static_cast<int>(u), static_cast<int>(v), around);
    if (p_C.z() < seen_m - margin_m) {
      ++counts.in_front;
    } else if (p_C.z() <= seen_m + margin_m) {
      ++counts.on;
    }
  }
  return counts;
}

}  // namespace tsdfpp
