#include "mapper/segment/surface_edges.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <vector>

#include "mapper/segment/surface_kernels.h"

namespace tsdfpp {
namespace {

constexpr int kFurthest = 255;

// Of each value that is not 0, how many such follow each other from there on, at most kFurthest.
void CountAhead(int count, std::uint8_t* values) {
  static const auto kCountDown = [] {
    std::array<std::uint8_t, kFurthest> down{};
    for (int i = 0; i < kFurthest; ++i) {
      down[static_cast<std::size_t>(i)] = static_cast<std::uint8_t>(kFurthest - i);
    }
    return down;
  }();
  std::uint8_t* const end = values + count;
  for (std::uint8_t* at = values; at != end;) {
    if (*at == 0) {
      ++at;
      continue;
    }
    std::uint8_t* const zero = std::find(at, end, std::uint8_t{0});
    const auto far = std::max<std::ptrdiff_t>(zero - at - kFurthest, 0);
    std::fill(at, at + far, std::uint8_t{kFurthest});
    std::copy(kCountDown.end() - (zero - at - far), kCountDown.end(), at + far);
    at = zero;
  }
}

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
                        1 / static_cast<float>(step), kSteepest * rays.pixel_width};
  reach_right.create(inverse.size(), CV_8UC1);
  reach_down.create(inverse.size(), CV_8UC1);
  const std::vector<float> nothing(static_cast<std::size_t>(cols), 0.0F);
  ForEachRow(rows, [&](int v) {
    const auto* q = inverse.ptr<float>(v);
    const auto* noise = sigma.ptr<float>(v);
    auto* right = reach_right.ptr<std::uint8_t>(v);
    // The row with nothing before and behind it.
    std::vector<float> padded(static_cast<std::size_t>(cols + 2 * step), 0.0F);
    std::copy(q, q + cols, padded.begin() + step);
    const float* behind = padded.data() + 2 * step + 1;
    const auto pairs = static_cast<std::size_t>(cols - 1);
    LinksOfRow({padded.data(), q, q + 1, behind, noise, noise + 1}, pairs, scale, right);
    right[cols - 1] = 0;
    CountAhead(cols, right);
    auto* down = reach_down.ptr<std::uint8_t>(v);
    if (v + 1 == rows) {
      std::fill(down, down + cols, std::uint8_t{0});
      return;
    }
    const JumpRow below{v >= step ? inverse.ptr<float>(v - step) : nothing.data(),
                        q,
                        inverse.ptr<float>(v + 1),
                        v + 1 + step < rows ? inverse.ptr<float>(v + 1 + step) : nothing.data(),
                        noise,
                        sigma.ptr<float>(v + 1)};
    LinksOfRow(below, static_cast<std::size_t>(cols), scale, down);
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
  const ChordScale scale{
      static_cast<float>(std::tan(config.concave_deg * std::numbers::pi / 180)),
      static_cast<float>(config.sigmas * std::sqrt(6.0) / (2 * reach.smooth_px + 1) * step) *
          rays.pixel_width};
  std::vector<float> slants;  // of chords along columns
  for (const float x : rays.x) slants.push_back(std::sqrt(1 + x * x));
  concave.create(depth.size(), CV_8UC1);
  ForEachRow(rows, [&](int v) {
    const auto* z = depth.ptr<float>(v);
    const auto* noise = sigma.ptr<float>(v);
    auto* to = concave.ptr<std::uint8_t>(v);
    std::fill(to, to + cols, std::uint8_t{0});
    const float* x = rays.x.data();
    const auto* y = &rays.y[static_cast<std::size_t>(v)];
    if (cols > 2 * step) {
      const float slant = std::sqrt(1 + *y * *y);
      const ChordRow along{z, z + step, z + 2 * step, x, x + step, x + 2 * step,
                           1, &slant,   noise + step};
      TurnsOfRow(along, static_cast<std::size_t>(cols - 2 * step), scale, to + step);
      const auto* right = reach_right.ptr<std::uint8_t>(v);
      for (int u = step; u < cols - step; ++u) {
        const bool whole = (right[u - step] >= step) & (right[u] >= step);
        to[u] = whole ? to[u] : std::uint8_t{0};
      }
    }
    if (v < step || v + step >= rows) return;
    std::vector<std::uint8_t> turns(static_cast<std::size_t>(cols));
    const ChordRow down{depth.ptr<float>(v - step),
                        z,
                        depth.ptr<float>(v + step),
                        y - step,
                        y,
                        y + step,
                        0,
                        slants.data(),
                        noise};
    TurnsOfRow(down, turns.size(), scale, turns.data());
    const auto* above = reach_down.ptr<std::uint8_t>(v - step);
    const auto* here = reach_down.ptr<std::uint8_t>(v);
    for (int u = 0; u < cols; ++u) {
      const bool whole = (above[u] >= step) & (here[u] >= step);
      to[u] |= whole ? turns[static_cast<std::size_t>(u)] : std::uint8_t{0};
    }
  });
}

}  // namespace tsdfpp
