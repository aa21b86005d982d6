#include "eval/tools/rasteriser.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

namespace tsdfpp {
namespace {

constexpr float kNearest_m = 0.05F;
constexpr int kRowsPerBand = 30;

struct Projected {
  float u;
  float v;
  float inverse_z;  // negative where not in front
};

void RasteriseTriangle(const Projected& a, const Projected& b, const Projected& c, int index,
                       int first_row, int last_row, Raster& out) {
  const float low_u = std::min({a.u, b.u, c.u});
  const float high_u = std::max({a.u, b.u, c.u});
  const float low_v = std::min({a.v, b.v, c.v});
  const float high_v = std::max({a.v, b.v, c.v});
  const auto width = static_cast<float>(out.depth.cols);
  if (high_v < static_cast<float>(first_row) || low_v > static_cast<float>(last_row) ||
      high_u < 0 || low_u > width - 1) {
    return;
  }
  const float area = (b.u - a.u) * (c.v - a.v) - (b.v - a.v) * (c.u - a.u);
  if (area == 0) return;
  const int u0 = static_cast<int>(std::ceil(std::max(low_u, 0.0F)));
  const int u1 = static_cast<int>(std::floor(std::min(high_u, width - 1)));
  const int v0 = static_cast<int>(std::ceil(std::max(low_v, static_cast<float>(first_row))));
  const int v1 = static_cast<int>(std::floor(std::min(high_v, static_cast<float>(last_row))));
  for (int v = v0; v <= v1; ++v) {
    auto* depth = out.depth.ptr<float>(v);
    auto* face = out.face.ptr<int>(v);
    for (int u = u0; u <= u1; ++u) {
      const auto x = static_cast<float>(u);
      const auto y = static_cast<float>(v);
      const float wa = ((b.u - x) * (c.v - y) - (b.v - y) * (c.u - x)) / area;
      const float wb = ((c.u - x) * (a.v - y) - (c.v - y) * (a.u - x)) / area;
      const float wc = 1 - wa - wb;
      if (wa < 0 || wb < 0 || wc < 0) continue;
      // 1/z is linear on the image.
      const float z = 1.0F / (wa * a.inverse_z + wb * b.inverse_z + wc * c.inverse_z);
      if (face[u] >= 0 && depth[u] <= z) continue;
      depth[u] = z;
      face[u] = index;
    }
  }
}

}  // namespace

Raster Rasterise(const TriangleMesh& mesh_W, const Intrinsics& intrinsics, const Pose& T_WC) {
  Raster out{cv::Mat(intrinsics.height, intrinsics.width, CV_32FC1, cv::Scalar(0)),
             cv::Mat(intrinsics.height, intrinsics.width, CV_32SC1, cv::Scalar(-1))};
  const Eigen::Isometry3f T_CW = T_WC.inverse().cast<float>();
  std::vector<Projected> projected(mesh_W.vertices.size());
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, projected.size(), 8192),
      [&](const tbb::blocked_range<std::size_t>& range) {
        for (std::size_t i = range.begin(); i != range.end(); ++i) {
          const Eigen::Vector3f p_C = T_CW * mesh_W.vertices[i];
          if (p_C.z() < kNearest_m) {
            projected[i] = {0, 0, -1};
            continue;
          }
          const float iz = 1.0F / p_C.z();
          projected[i] = {
              static_cast<float>(intrinsics.fx) * p_C.x() * iz + static_cast<float>(intrinsics.cx),
              static_cast<float>(intrinsics.fy) * p_C.y() * iz + static_cast<float>(intrinsics.cy),
              iz};
        }
      });
  const int bands = (intrinsics.height + kRowsPerBand - 1) / kRowsPerBand;
  // The triangles that meet each band, in their order.
  std::vector<std::vector<std::uint32_t>> of_band(static_cast<std::size_t>(bands));
  const auto width = static_cast<float>(intrinsics.width);
  const auto height = static_cast<float>(intrinsics.height);
  for (std::size_t i = 0; i < mesh_W.triangles.size(); ++i) {
    const auto& t = mesh_W.triangles[i];
    const Projected& a = projected[t[0]];
    const Projected& b = projected[t[1]];
    const Projected& c = projected[t[2]];
    if (a.inverse_z < 0 || b.inverse_z < 0 || c.inverse_z < 0) continue;
    const float low = std::min({a.v, b.v, c.v});
    const float high = std::max({a.v, b.v, c.v});
    // Written so that what is no number belongs to no band.
    if (!(high >= 0 && low <= height - 1) || !(std::max({a.u, b.u, c.u}) >= 0) ||
        !(std::min({a.u, b.u, c.u}) <= width - 1)) {
      continue;
    }
    const int first = static_cast<int>(std::max(low, 0.0F)) / kRowsPerBand;
    const int last = static_cast<int>(std::min(high, height - 1)) / kRowsPerBand;
    for (int band = first; band <= last; ++band) {
      of_band[static_cast<std::size_t>(band)].push_back(static_cast<std::uint32_t>(i));
    }
  }
  tbb::parallel_for(0, bands, [&](int band) {
    const int first = band * kRowsPerBand;
    const int last = std::min(intrinsics.height, first + kRowsPerBand) - 1;
    for (const std::uint32_t i : of_band[static_cast<std::size_t>(band)]) {
      const auto& t = mesh_W.triangles[i];
      RasteriseTriangle(projected[t[0]], projected[t[1]], projected[t[2]], static_cast<int>(i),
                        first, last, out);
    }
  });
  return out;
}

}  // namespace tsdfpp
