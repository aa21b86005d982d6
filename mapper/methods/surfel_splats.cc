#include "mapper/methods/surfel_splats.h"

#include <algorithm>
#include <cmath>

namespace tsdfpp {
namespace {

// Boxes are made larger by this: pixels, far above rounding.
constexpr double kBoxSlack = 1e-6;
// A disc that reaches nearer than this may be seen anywhere in the image.
constexpr double kNearest_m = 1e-3;

struct Interval {
  double low = 0;
  double high = 0;
};

// Of x / z, for x and z in boxes around the centre; z stays above 0.
Interval Slopes(double x, double half_x, double z, double half_z) {
  const double low = x - half_x;
  const double high = x + half_x;
  return {low / (low < 0 ? z - half_z : z + half_z), high / (high > 0 ? z - half_z : z + half_z)};
}

// Pixels from low to high, cut to the image: first and one beyond the last.
std::pair<std::uint32_t, std::uint32_t> PixelsIn(double low, double high, int size) {
  const double first = std::max(0.0, std::ceil(low - kBoxSlack));
  const double end = std::min<double>(size, std::floor(high + kBoxSlack) + 1);
  if (!(first < end)) return {0, 0};
  return {static_cast<std::uint32_t>(first), static_cast<std::uint32_t>(end)};
}

}  // namespace

PixelRays::PixelRays(const Intrinsics& camera) {
  for (int u = 0; u < camera.width; ++u) x_.push_back((u - camera.cx) / camera.fx);
  for (int v = 0; v < camera.height; ++v) y_.push_back((v - camera.cy) / camera.fy);
}

Splat SplatOf(const Eigen::Vector3d& centre_C, const Eigen::Vector3d& normal_C, double radius_m,
              const Intrinsics& camera) {
  Splat splat;
  splat.centre_C = centre_C;
  splat.normal_C = normal_C;
  splat.plane_m = normal_C.dot(centre_C);
  splat.radius2 = radius_m * radius_m;
  // Half the extent of the disc along each axis.
  const Eigen::Vector3d half = radius_m * (1 - normal_C.array().square()).max(0).sqrt().matrix();
  if (!(splat.plane_m < 0) || !(centre_C.z() + half.z() > 0)) return splat;
  if (centre_C.z() - half.z() < kNearest_m) {
    splat.u1 = static_cast<std::uint32_t>(camera.width);
    splat.v1 = static_cast<std::uint32_t>(camera.height);
    return splat;
  }
  const Interval x = Slopes(centre_C.x(), half.x(), centre_C.z(), half.z());
  const Interval y = Slopes(centre_C.y(), half.y(), centre_C.z(), half.z());
  const auto [u0, u1] =
      PixelsIn(camera.fx * x.low + camera.cx, camera.fx * x.high + camera.cx, camera.width);
  const auto [v0, v1] =
      PixelsIn(camera.fy * y.low + camera.cy, camera.fy * y.high + camera.cy, camera.height);
  if (u0 == u1 || v0 == v1) return splat;
  splat.u0 = u0;
  splat.u1 = u1;
  splat.v0 = v0;
  splat.v1 = v1;
  return splat;
}

SplatBands::SplatBands(const std::vector<Splat>& splats, int height)
    : height_(static_cast<std::size_t>(height)), begin_((height_ + kRows - 1) / kRows + 1) {
  const auto for_each_band = [&](const auto& visit) {
    for (std::size_t i = 0; i < splats.size(); ++i) {
      if (splats[i].u0 == splats[i].u1) continue;
      for (std::size_t b = splats[i].v0 / kRows; b * kRows < splats[i].v1; ++b) visit(b, i);
    }
  };
  std::vector<std::size_t> count(size());
  for_each_band([&](std::size_t band, std::size_t) { ++count[band]; });
  for (std::size_t b = 0; b < size(); ++b) begin_[b + 1] = begin_[b] + count[b];
  numbers_.resize(begin_.back());
  std::vector<std::size_t> place(begin_.begin(), begin_.end() - 1);
  for_each_band([&](std::size_t band, std::size_t i) {
    numbers_[place[band]++] = static_cast<std::uint32_t>(i);
  });
}

std::size_t SplatBands::EndRow(std::size_t band) const {
  return std::min(height_, (band + 1) * kRows);
}

}  // namespace tsdfpp
