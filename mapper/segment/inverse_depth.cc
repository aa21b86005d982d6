#include "mapper/segment/inverse_depth.h"

#include <cmath>
#include <cstdint>
#include <vector>

#include "mapper/segment/pixel_rays.h"
#include "mapper/segment/surface_kernels.h"

namespace tsdfpp {
namespace {

// Up to how far apart the values at the two ends of a hole may be, 1/m.
float GapTolerance(float q, int pixels, float pixel, const DepthSegmentsConfig& config) {
  const NoiseModel noise(config.noise, config.noise_scale);
  const float noise_q =
      static_cast<float>(config.sigmas) * std::sqrt(2.0F) * noise.HeadOnInverse(q);
  return noise_q + kSteepest * pixel * q * static_cast<float>(pixels);
}

// The value in a hole between the first values on either side, 0 where it is too wide or its ends
// are a jump. `at(i)` is the value i pixels on; the hole is at 0.
template <typename At>
float Bridged(const At& at, float pixel, const DepthSegmentsConfig& config) {
  int before = 1;
  while (before <= config.gap_px && at(-before) == 0) ++before;
  int after = 1;
  while (after <= config.gap_px && at(after) == 0) ++after;
  if (before + after - 1 > config.gap_px) return 0;
  const float first = at(-before);
  const float last = at(after);
  const auto span = static_cast<float>(before + after);
  const float mean = (first + last) / 2;
  if (std::abs(first - last) > GapTolerance(mean, before + after, pixel, config)) return 0;
  return (first * static_cast<float>(after) + last * static_cast<float>(before)) / span;
}

PairScale PairScaleOf(const DepthSegmentsConfig& config, float pixel, int i) {
  const NoiseModel noise(config.noise, config.noise_scale);
  return {noise.scale, static_cast<float>(config.sigmas * std::sqrt(6.0)),
          noise.scale * kSmoothShift_px / static_cast<float>(2 * i),
          noise.scale * kSmoothShift_px * kSteepest * pixel};
}

}  // namespace

ChordReach ChooseReach(const cv::Mat& depth, float pixel, const DepthSegmentsConfig& config) {
  ChordReach reach{kLeastStep_px, (kLeastStep_px - 1) / 2};
  if (config.noise == DepthNoise::kExact) return reach;
  // The median to a centimetre, of every fourth row's every fourth pixel.
  constexpr int kStride = 4;
  constexpr float kBins_per_m = 100;
  std::vector<std::int64_t> bins(static_cast<std::size_t>(kMaxValidDepth_m * kBins_per_m) + 1);
  std::int64_t count = 0;
  for (int v = 0; v < depth.rows; v += kStride) {
    const auto* row = depth.ptr<float>(v);
    for (int u = 0; u < depth.cols; u += kStride) {
      if (!IsValidDepth(row[u])) continue;
      ++bins[static_cast<std::size_t>(row[u] * kBins_per_m)];
      ++count;
    }
  }
  if (count == 0) return reach;
  std::size_t bin = 0;
  for (std::int64_t below = bins[0]; 2 * below < count; below += bins[bin]) ++bin;
  const float z_m = (static_cast<float>(bin) + 0.5F) / kBins_per_m;
  // Noise bends a chord of two steps by sqrt(6) sigma / (step * width of a pixel); the mean over
  // about as many rows and columns as a step is long divides that by the step.
  const NoiseModel noise(config.noise, config.noise_scale);
  const double noise_px = noise.HeadOn_m(z_m) / (static_cast<double>(pixel) * z_m);
  const double step = std::sqrt(std::sqrt(6.0) * config.sigmas * noise_px / kNoiseBend);
  reach.step_px = static_cast<int>(
      std::min(std::max(std::ceil(step), double{kLeastStep_px}), double{kGreatestStep_px}));
  reach.smooth_px = (reach.step_px - 1) / 2;
  return reach;
}

void TakeInverse(const cv::Mat& depth, cv::Mat& inverse) {
  inverse.create(depth.size(), CV_32FC1);
  ForEachRow(depth.rows, [&](int v) {
    const auto* from = depth.ptr<float>(v);
    auto* to = inverse.ptr<float>(v);
    for (int u = 0; u < depth.cols; ++u) {
      const float z = from[u];
      const bool valid = (z >= kNearestInverted_m) & (z <= kMaxValidDepth_m);
      to[u] = valid ? 1 / z : 0;
    }
  });
}

void BridgeGaps(float pixel, const DepthSegmentsConfig& config, const cv::Mat& inverse,
                cv::Mat& along_rows, cv::Mat& bridged) {
  along_rows.create(inverse.size(), CV_32FC1);
  bridged.create(inverse.size(), CV_32FC1);
  const int rows = inverse.rows;
  const int cols = inverse.cols;
  ForEachRow(rows, [&](int v) {
    const auto* from = inverse.ptr<float>(v);
    auto* to = along_rows.ptr<float>(v);
    std::copy(from, from + cols, to);
    if (config.gap_px == 0) return;
    for (int u = 0; u < cols; ++u) {
      if (from[u] != 0) continue;
      const auto at = [&](int i) { return u + i < 0 || u + i >= cols ? 0 : from[u + i]; };
      to[u] = Bridged(at, pixel, config);
    }
  });
  ForEachRow(rows, [&](int v) {
    const auto* from = along_rows.ptr<float>(v);
    auto* to = bridged.ptr<float>(v);
    std::copy(from, from + cols, to);
    if (config.gap_px == 0) return;
    for (int u = 0; u < cols; ++u) {
      if (from[u] != 0) continue;
      const auto at = [&](int i) {
        return v + i < 0 || v + i >= rows ? 0 : along_rows.ptr<float>(v + i)[u];
      };
      to[u] = Bridged(at, pixel, config);
    }
  });
}

void Smooth(const cv::Mat& inverse, int smooth_px, float pixel, const DepthSegmentsConfig& config,
            cv::Mat& scratch, cv::Mat& smooth, cv::Mat& depth) {
  const int rows = inverse.rows;
  const int cols = inverse.cols;
  scratch.create(inverse.size(), CV_32FC1);
  smooth.create(inverse.size(), CV_32FC1);
  depth.create(inverse.size(), CV_32FC1);
  const auto width = static_cast<std::size_t>(cols);
  std::vector<PairScale> scales(1);  // by i
  for (int i = 1; i <= smooth_px; ++i) scales.push_back(PairScaleOf(config, pixel, i));
  ForEachRow(rows, [&](int v) {
    const auto* from = inverse.ptr<float>(v);
    std::vector<float> sum(from, from + cols);
    std::vector<float> count(width, 1.0F);
    for (std::size_t i = 1; i < scales.size() && 2 * i < width; ++i) {
      AddPairs(from, from + i, from + 2 * i, width - 2 * i, scales[i], &sum[i], &count[i]);
    }
    auto* to = scratch.ptr<float>(v);
    for (std::size_t u = 0; u < width; ++u) to[u] = sum[u] / count[u];
  });
  ForEachRow(rows, [&](int v) {
    const auto* from = scratch.ptr<float>(v);
    std::vector<float> sum(from, from + cols);
    std::vector<float> count(width, 1.0F);
    for (int i = 1; i <= smooth_px && i <= v && v + i < rows; ++i) {
      AddPairs(scratch.ptr<float>(v - i), from, scratch.ptr<float>(v + i), width,
               scales[static_cast<std::size_t>(i)], sum.data(), count.data());
    }
    auto* to = smooth.ptr<float>(v);
    auto* z = depth.ptr<float>(v);
    for (std::size_t u = 0; u < width; ++u) {
      to[u] = sum[u] / count[u];
      z[u] = to[u] == 0 ? 0 : 1 / to[u];
    }
  });
}

}  // namespace tsdfpp
