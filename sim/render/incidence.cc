#include "sim/render/incidence.h"

#include <algorithm>
#include <cmath>

#include "core/pixel_ray.h"
#include "sim/render/parallel_rows.h"

namespace tsdfpp {
namespace {

// A neighbour's pixel offset and depth.
struct Step {
  int offset = 1;
  double z = 0;
};

// The neighbour at +-1 along an axis that continues the surface of depth z best.
Step BestStep(double z, float before, float after) {
  const bool has_before = IsValidDepth(before);
  const bool has_after = IsValidDepth(after);
  if (has_after && (!has_before || std::abs(after - z) <= std::abs(before - z))) return {1, after};
  if (has_before) return {-1, before};
  return {1, z};
}

}  // namespace

cv::Mat IncidenceAngles(const cv::Mat& depth, const Intrinsics& intrinsics) {
  const Intrinsics& k = intrinsics;
  cv::Mat angles(depth.size(), CV_32FC1);
  const auto ray = [&](int u, int v) { return PixelRay(k, u, v); };
  ParallelRows(depth.rows, [&](int v) {
    const auto* row = depth.ptr<float>(v);
    const float* above = v > 0 ? depth.ptr<float>(v - 1) : nullptr;
    const float* below = v + 1 < depth.rows ? depth.ptr<float>(v + 1) : nullptr;
    auto* out = angles.ptr<float>(v);
    for (int u = 0; u < depth.cols; ++u) {
      out[u] = 0;
      if (!IsValidDepth(row[u])) continue;
      const double z = row[u];
      const Step right =
          BestStep(z, u > 0 ? row[u - 1] : 0.0F, u + 1 < depth.cols ? row[u + 1] : 0.0F);
      const Step down =
          BestStep(z, above != nullptr ? above[u] : 0.0F, below != nullptr ? below[u] : 0.0F);
      const Eigen::Vector3d here = ray(u, v);
      const Eigen::Vector3d along_u = right.z * ray(u + right.offset, v) - z * here;
      const Eigen::Vector3d along_v = down.z * ray(u, v + down.offset) - z * here;
      const Eigen::Vector3d normal = along_u.cross(along_v);
      const double cosine = std::abs(normal.dot(here)) / (normal.norm() * here.norm());
      out[u] = static_cast<float>(std::acos(std::min(1.0, cosine)));
    }
  });
  return angles;
}

}  // namespace tsdfpp
