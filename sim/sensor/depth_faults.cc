#include "sim/sensor/depth_faults.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/random.h"
#include "core/units.h"
#include "sim/render/parallel_rows.h"
#include "sim/sensor/sensor_streams.h"

namespace tsdfpp {
namespace {

std::uint32_t PixelKey(const cv::Mat& image, int v, int u) {
  return static_cast<std::uint32_t>(v * image.cols + u);
}

std::array<double, 4> Draw(std::uint64_t seed, SensorStream stream, int frame, std::uint32_t key) {
  return UniformDraw(seed, stream, static_cast<std::uint64_t>(frame), key);
}

// One row of the projector's depth buffer, in disparity; columns from -width to 2 width.
class ProjectorRow {
 public:
  explicit ProjectorRow(int width) : width_(width), nearest_(3 * static_cast<std::size_t>(width)) {}

  void Clear() { std::fill(nearest_.begin(), nearest_.end(), 0.0); }

  // Draws the columns from a to b, disparity linear between them.
  void Line(double column_a, double disparity_a, double column_b, double disparity_b) {
    const double length = column_b - column_a;
    const int last = Column(column_b);
    for (int column = Column(column_a); column <= last; ++column) {
      if (!Contains(column)) continue;
      const double t = length > 0 ? std::clamp((column - column_a) / length, 0.0, 1.0) : 0.0;
      double& nearest = nearest_[static_cast<std::size_t>(column + width_)];
      nearest = std::max(nearest, disparity_a + t * (disparity_b - disparity_a));
    }
  }

  // The disparity seen in this column; 0 where nothing is.
  double At(double column) const {
    const int at = Column(column);
    return Contains(at) ? nearest_[static_cast<std::size_t>(at + width_)] : 0.0;
  }

 private:
  // Beyond every image, so that a near pixel's column cannot overflow.
  static int Column(double column) {
    return static_cast<int>(std::floor(std::clamp(column, -1e6, 1e6) + 0.5));
  }
  bool Contains(int column) const { return column >= -width_ && column < 2 * width_; }

  int width_;
  std::vector<double> nearest_;
};

}  // namespace

cv::Mat CastProjectorShadow(const cv::Mat& depth, const Intrinsics& intrinsics, double baseline_m) {
  cv::Mat result = depth.clone();
  const double focal_baseline = intrinsics.fx * baseline_m;
  ParallelRows(depth.rows, [&](int v) {
    const auto* row = depth.ptr<float>(v);
    auto* out = result.ptr<float>(v);
    ProjectorRow projector(depth.cols);
    const auto disparity = [&](int u) { return focal_baseline / row[u]; };
    for (int u = 0; u < depth.cols; ++u) {
      if (!IsValidDepth(row[u])) continue;
      const double here = disparity(u);
      projector.Line(u - here, here, u - here, here);
      if (u + 1 == depth.cols || !IsValidDepth(row[u + 1])) continue;
      const double next = disparity(u + 1);
      if (std::abs(next - here) <= 1) projector.Line(u - here, here, u + 1 - next, next);
    }
    for (int u = 0; u < depth.cols; ++u) {
      if (!IsValidDepth(row[u])) continue;
      const double here = disparity(u);
      if (projector.At(u - here) > here + kShadowSlack_px) out[u] = 0;
    }
  });
  return result;
}

cv::Mat MixFlyingPixels(const cv::Mat& depth, double rate, double step_m, std::uint64_t seed,
                        int frame) {
  cv::Mat result = depth.clone();
  ParallelRows(depth.rows, [&](int v) {
    for (int u = 0; u < depth.cols; ++u) {
      const float z = depth.at<float>(v, u);
      if (!IsValidDepth(z)) continue;
      float other = z;
      for (int y = std::max(0, v - 1); y <= std::min(depth.rows - 1, v + 1); ++y) {
        for (int x = std::max(0, u - 1); x <= std::min(depth.cols - 1, u + 1); ++x) {
          const float z_n = depth.at<float>(y, x);
          if (IsValidDepth(z_n) && std::abs(z_n - z) > std::abs(other - z)) other = z_n;
        }
      }
      if (!(std::abs(other - z) > step_m)) continue;
      const auto draw = Draw(seed, kStreamFlyingPixels, frame, PixelKey(depth, v, u));
      if (draw[0] < rate) result.at<float>(v, u) = static_cast<float>(z + draw[1] * (other - z));
    }
  });
  return result;
}

double RampProbability(double value, double start, double end) {
  if (value <= start) return 0;
  if (value >= end) return 1;
  return (value - start) / (end - start);
}

bool DropsByIncidence(const DepthSensorConfig& config) {
  return config.dropout_incidence_start_deg < 90;
}

bool DropsByRange(const DepthSensorConfig& config) {
  return config.dropout_range_start_m < kMaxValidDepth_m;
}

cv::Mat DropOut(const cv::Mat& depth, const cv::Mat& true_depth, const cv::Mat& incidence,
                const DepthSensorConfig& config, std::uint64_t seed, int frame) {
  cv::Mat result = depth.clone();
  const double start = config.dropout_incidence_start_deg * kDegree;
  const double end = config.dropout_incidence_end_deg * kDegree;
  ParallelRows(depth.rows, [&](int v) {
    auto* out = result.ptr<float>(v);
    for (int u = 0; u < depth.cols; ++u) {
      if (out[u] == 0) continue;
      double kept = 1;
      if (DropsByIncidence(config)) {
        kept *= 1 - RampProbability(incidence.at<float>(v, u), start, end);
      }
      kept *= 1 - RampProbability(true_depth.at<float>(v, u), config.dropout_range_start_m,
                                  config.dropout_range_end_m);
      if (kept == 1) continue;
      if (Draw(seed, kStreamDropOut, frame, PixelKey(depth, v, u))[0] >= kept) out[u] = 0;
    }
  });
  return result;
}

cv::Mat CutRange(const cv::Mat& depth, double min_m, double max_m) {
  cv::Mat result = depth.clone();
  ParallelRows(depth.rows, [&](int v) {
    auto* out = result.ptr<float>(v);
    for (int u = 0; u < depth.cols; ++u) {
      if (!IsValidDepth(out[u]) || out[u] < min_m || out[u] > max_m) out[u] = 0;
    }
  });
  return result;
}

cv::Mat QuantiseDepth(const cv::Mat& depth, double unit_m) {
  cv::Mat result = depth.clone();
  ParallelRows(depth.rows, [&](int v) {
    auto* out = result.ptr<float>(v);
    for (int u = 0; u < depth.cols; ++u) {
      out[u] = static_cast<float>(std::round(out[u] / unit_m) * unit_m);
    }
  });
  return result;
}

}  // namespace tsdfpp
