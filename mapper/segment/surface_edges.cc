#include "mapper/segment/surface_edges.h"

#include <tbb/parallel_for.h>

#include <cmath>
#include <cstdint>
#include <numbers>

namespace tsdfpp {
namespace {

// A surface that has no neighbours to tell its slope by may be as steep as this (tangent of the
// angle of incidence, 80 deg).
constexpr float kSteepestJump = 5.67F;

struct JumpScale {
  float noise = 0;     // of sigma
  float width = 0;     // of depth
  float per_step = 0;  // 1 / s
  float steepest = 0;  // of depth
};

// Whether the values q0 and q1 of neighbours are parted, with `before` s pixels before q0 and
// `behind` s pixels behind q1; without a branch, so that rows are computed several pixels at once.
inline bool IsJump(float before, float q0, float q1, float behind, float sigma0, float sigma1,
                   const JumpScale& scale) {
  const float nearer = q0 > q1 ? q0 : q1;
  const float sigma = q0 > q1 ? sigma0 : sigma1;
  const float width = scale.width * nearer;  // times z / z^2
  const float tolerance = scale.noise * sigma * nearer * nearer + width;
  const float step = q1 - q0;
  const bool has0 = before != 0;
  const bool has1 = behind != 0;
  const float off0 = std::abs(step - (q0 - before) * scale.per_step);
  const float off1 = std::abs(step - (behind - q1) * scale.per_step);
  const float alone = std::abs(step) - scale.steepest * nearer;
  const float best0 = has0 ? off0 : (has1 ? off1 : alone);
  const float best1 = has1 ? off1 : (has0 ? off0 : alone);
  const float best = best0 < best1 ? best0 : best1;
  return (q0 == 0) | (q1 == 0) | !(best <= tolerance);
}

// Whether a profile turns towards the camera: (x, d) are the coordinates along it and in depth of
// its halves, both in the plane of the camera and the profile.
inline bool TurnsIn(float x0, float d0, float x1, float d1, float tangent, float noise) {
  const float turn = d0 * x1 - x0 * d1;  // |A| |B| sin, positive where the middle is far
  const float along = x0 * x1 + d0 * d1;
  const float half0 = x0 * x0 + d0 * d0;
  const float half1 = x1 * x1 + d1 * d1;
  const float shorter = half0 < half1 ? half0 : half1;
  const float ahead = along > 0 ? along : 0;
  // Both sides times h^2, which may be 0.
  return turn * shorter > (tangent * shorter + noise) * ahead && turn > 0;
}

struct ConcaveScale {
  float tangent = 0;
  float noise = 0;  // of sigma z
};

}  // namespace

void FindJumps(const PixelRays& rays, const ChordReach& reach, const DepthSegmentsConfig& config,
               const cv::Mat& inverse, const cv::Mat& sigma, cv::Mat& reach_right,
               cv::Mat& reach_down) {
  const int rows = inverse.rows;
  const int cols = inverse.cols;
  const int step = reach.step_px;
  const auto window = static_cast<float>((2 * reach.smooth_px + 1) * (reach.smooth_px + 1));
  const JumpScale scale{static_cast<float>(config.sigmas) * std::sqrt(2 / window),
                        static_cast<float>(config.jump_px) * rays.pixel_width,
                        1 / static_cast<float>(step), kSteepestJump * rays.pixel_width};
  reach_right.create(inverse.size(), CV_8UC1);
  reach_down.create(inverse.size(), CV_8UC1);
  const std::vector<float> nothing(static_cast<std::size_t>(cols), 0.0F);
  ForEachRow(rows, [&](int v) {
    const auto* q = inverse.ptr<float>(v);
    const auto* noise = sigma.ptr<float>(v);
    auto* right = reach_right.ptr<std::uint8_t>(v);
    const auto jumps = [&](int u) {
      const float before = u >= step ? q[u - step] : 0;
      const float behind = u + 1 + step < cols ? q[u + 1 + step] : 0;
      return IsJump(before, q[u], q[u + 1], behind, noise[u], noise[u + 1], scale);
    };
    const int inner_end = cols - 1 - step;
    for (int u = 0; u < std::min(step, cols - 1); ++u) right[u] = jumps(u) ? 0 : 1;
    for (int u = step; u < inner_end; ++u) {
      right[u] = IsJump(q[u - step], q[u], q[u + 1], q[u + 1 + step], noise[u], noise[u + 1], scale)
                     ? 0
                     : 1;
    }
    for (int u = std::max(step, inner_end); u < cols - 1; ++u) right[u] = jumps(u) ? 0 : 1;
    right[cols - 1] = 0;
    for (int u = cols - 2; u >= 0; --u) {
      if (right[u] != 0) right[u] = static_cast<std::uint8_t>(std::min(right[u + 1] + 1, 255));
    }
    auto* down = reach_down.ptr<std::uint8_t>(v);
    if (v + 1 == rows) {
      std::fill(down, down + cols, std::uint8_t{0});
      return;
    }
    const auto* q1 = inverse.ptr<float>(v + 1);
    const auto* noise1 = sigma.ptr<float>(v + 1);
    const float* before = v >= step ? inverse.ptr<float>(v - step) : nothing.data();
    const float* behind = v + 1 + step < rows ? inverse.ptr<float>(v + 1 + step) : nothing.data();
    for (int u = 0; u < cols; ++u) {
      down[u] = IsJump(before[u], q[u], q1[u], behind[u], noise[u], noise1[u], scale) ? 0 : 1;
    }
  });
  // From the last row up, a strip of columns a task.
  constexpr int kStrip = 128;
  tbb::parallel_for(
      tbb::blocked_range<int>(0, (cols + kStrip - 1) / kStrip, 1),
      [&](const tbb::blocked_range<int>& strips) {
        const int begin = strips.begin() * kStrip;
        const int end = std::min(cols, strips.end() * kStrip);
        for (int v = rows - 2; v >= 0; --v) {
          const auto* below = reach_down.ptr<std::uint8_t>(v + 1);
          auto* down = reach_down.ptr<std::uint8_t>(v);
          for (int u = begin; u < end; ++u) {
            const auto further = static_cast<std::uint8_t>(below[u] == 255 ? 255 : below[u] + 1);
            down[u] = down[u] != 0 ? further : std::uint8_t{0};
          }
        }
      },
      tbb::simple_partitioner());
}

void FindConcave(const PixelRays& rays, const ChordReach& reach, const DepthSegmentsConfig& config,
                 const cv::Mat& depth, const cv::Mat& sigma, const cv::Mat& reach_right,
                 const cv::Mat& reach_down, cv::Mat& concave) {
  const int rows = depth.rows;
  const int cols = depth.cols;
  const int step = reach.step_px;
  const ConcaveScale scale{
      static_cast<float>(std::tan(config.concave_deg * std::numbers::pi / 180)),
      static_cast<float>(config.sigmas * std::sqrt(6.0) / (2 * reach.smooth_px + 1) * step) *
          rays.pixel_width};
  concave.create(depth.size(), CV_8UC1);
  ForEachRow(rows, [&](int v) {
    const auto* z = depth.ptr<float>(v);
    const auto* noise = sigma.ptr<float>(v);
    const auto* right = reach_right.ptr<std::uint8_t>(v);
    auto* to = concave.ptr<std::uint8_t>(v);
    const float* ray = rays.x.data();
    const float ray_y = rays.y[static_cast<std::size_t>(v)];
    const float slant = std::sqrt(1 + ray_y * ray_y);
    std::fill(to, to + cols, std::uint8_t{0});
    for (int u = step; u < cols - step; ++u) {
      const bool whole = (right[u - step] >= step) & (right[u] >= step);
      const bool turns =
          TurnsIn(ray[u] * z[u] - ray[u - step] * z[u - step], slant * (z[u] - z[u - step]),
                  ray[u + step] * z[u + step] - ray[u] * z[u], slant * (z[u + step] - z[u]),
                  scale.tangent, scale.noise * noise[u] * z[u]);
      to[u] = whole & turns ? 255 : 0;
    }
    if (v < step || v + step >= rows) return;
    const auto* z0 = depth.ptr<float>(v - step);
    const auto* z1 = depth.ptr<float>(v + step);
    const auto* down0 = reach_down.ptr<std::uint8_t>(v - step);
    const auto* down = reach_down.ptr<std::uint8_t>(v);
    const float y0 = rays.y[static_cast<std::size_t>(v - step)];
    const float y1 = rays.y[static_cast<std::size_t>(v + step)];
    for (int u = 0; u < cols; ++u) {
      const float slant_x = std::sqrt(1 + ray[u] * ray[u]);
      const bool whole = (down0[u] >= step) & (down[u] >= step);
      const bool turns =
          TurnsIn(ray_y * z[u] - y0 * z0[u], slant_x * (z[u] - z0[u]), y1 * z1[u] - ray_y * z[u],
                  slant_x * (z1[u] - z[u]), scale.tangent, scale.noise * noise[u] * z[u]);
      to[u] = to[u] | (whole & turns ? 255 : 0);
    }
  });
}

}  // namespace tsdfpp
