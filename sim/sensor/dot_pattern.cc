#include "sim/sensor/dot_pattern.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/random.h"
#include "sim/render/parallel_rows.h"
#include "sim/sensor/sensor_streams.h"

namespace tsdfpp {
namespace {

constexpr int kHalf = kDotWindow_px / 2;

bool DotMatches(const cv::Mat& disparity, const cv::Mat& dots, int v, int u) {
  int dot_count = 0;
  int known_dots = 0;
  int known = 0;
  double sum = 0;
  for (int y = v - kHalf; y <= v + kHalf; ++y) {
    const auto* d = disparity.ptr<float>(y);
    const auto* dot = dots.ptr<std::uint8_t>(y);
    for (int x = u - kHalf; x <= u + kHalf; ++x) {
      dot_count += dot[x];
      if (d[x] <= 0) continue;
      known_dots += dot[x];
      sum += d[x];
      ++known;
    }
  }
  const double needed = dot_count * kDotShare;
  if (disparity.at<float>(v, u) <= 0 || known_dots <= needed) return false;
  const double mean = sum / known;
  int agreeing = 0;
  for (int y = v - kHalf; y <= v + kHalf; ++y) {
    const auto* d = disparity.ptr<float>(y);
    const auto* dot = dots.ptr<std::uint8_t>(y);
    for (int x = u - kHalf; x <= u + kHalf; ++x) {
      if (dot[x] == 0 || d[x] <= 0) continue;
      const int square = (x - u) * (x - u) + (y - v) * (y - v);
      const double weight = square == 0 ? 1.0 : 1 / (kDotWeight * square);
      if (std::abs(d[x] - mean) * weight < kDotInlier_px) ++agreeing;
    }
  }
  return agreeing > needed;
}

struct Offset {
  int dv = 0;
  int du = 0;
  int square = 0;
};

// The disc of kDotFill_px, nearest first and then in reading order.
std::vector<Offset> FillOffsets() {
  std::vector<Offset> offsets;
  for (int dv = -kDotFill_px; dv <= kDotFill_px; ++dv) {
    for (int du = -kDotFill_px; du <= kDotFill_px; ++du) {
      const int square = dv * dv + du * du;
      if (square <= kDotFill_px * kDotFill_px) offsets.push_back({dv, du, square});
    }
  }
  std::stable_sort(offsets.begin(), offsets.end(),
                   [](const Offset& a, const Offset& b) { return a.square < b.square; });
  return offsets;
}

}  // namespace

cv::Mat MakeDotPattern(std::uint64_t seed, cv::Size size) {
  cv::Mat dots = cv::Mat::zeros(size, CV_8UC1);
  const int cells_u = (size.width + kDotCell_px - 1) / kDotCell_px;
  const int cells_v = (size.height + kDotCell_px - 1) / kDotCell_px;
  for (int j = 0; j < cells_v; ++j) {
    for (int i = 0; i < cells_u; ++i) {
      const auto draw = UniformDraw(seed, kStreamDotPattern, static_cast<std::uint64_t>(j),
                                    static_cast<std::uint32_t>(i));
      const int u = i * kDotCell_px + static_cast<int>(draw[0] * kDotCell_px);
      const int v = j * kDotCell_px + static_cast<int>(draw[1] * kDotCell_px);
      if (u < size.width && v < size.height) dots.at<std::uint8_t>(v, u) = 1;
    }
  }
  return dots;
}

cv::Mat MatchDots(const cv::Mat& disparity, const cv::Mat& dots) {
  CV_Assert(disparity.type() == CV_32FC1 && dots.type() == CV_8UC1);
  CV_Assert(disparity.size() == dots.size());
  const int rows = disparity.rows;
  const int cols = disparity.cols;
  cv::Mat matched = cv::Mat::zeros(disparity.size(), CV_8UC1);
  ParallelRows(rows, [&](int v) {
    if (v < kHalf || v >= rows - kHalf) return;
    const auto* dot = dots.ptr<std::uint8_t>(v);
    auto* out = matched.ptr<std::uint8_t>(v);
    for (int u = kHalf; u < cols - kHalf; ++u) {
      if (dot[u] != 0 && DotMatches(disparity, dots, v, u)) out[u] = 1;
    }
  });
  static const std::vector<Offset> kOffsets = FillOffsets();
  cv::Mat result = cv::Mat::zeros(disparity.size(), CV_32FC1);
  ParallelRows(rows, [&](int v) {
    auto* out = result.ptr<float>(v);
    for (int u = 0; u < cols; ++u) {
      for (const Offset& offset : kOffsets) {
        const int y = v + offset.dv;
        const int x = u + offset.du;
        if (y < 0 || y >= rows || x < 0 || x >= cols || matched.at<std::uint8_t>(y, x) == 0) {
          continue;
        }
        out[u] = static_cast<float>(std::round(disparity.at<float>(y, x) / kDisparityStep_px) *
                                    kDisparityStep_px);
        break;
      }
    }
  });
  return result;
}

}  // namespace tsdfpp
