#include "mapper/segment/bleeding.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <opencv2/imgproc.hpp>

#include "core/types.h"

namespace tsdfpp {
namespace {

constexpr int kSide = 2 * kBleedingReach_px + 1;
constexpr int kRowsPerTask = 16;

// Depths of a window, on one side of an outline.
class Depths {
 public:
  void Add(float z) { values_[count_++] = z; }
  bool empty() const { return count_ == 0; }
  // Of an even number the upper one. There must be one.
  float Median() {
    const auto middle = values_.begin() + static_cast<std::ptrdiff_t>(count_ / 2);
    std::nth_element(values_.begin(), middle,
                     values_.begin() + static_cast<std::ptrdiff_t>(count_));
    return *middle;
  }

 private:
  std::array<float, std::size_t{kSide} * kSide> values_{};
  std::size_t count_ = 0;
};

bool Bleeds(const cv::Mat& depth, const cv::Mat& ids, int v, int u, float step_m) {
  const InstanceId id = ids.at<InstanceId>(v, u);
  const float z = depth.at<float>(v, u);
  if (id == kNoInstance || !IsValidDepth(z)) return false;
  Depths own;
  Depths others;
  for (int y = std::max(0, v - kBleedingReach_px);
       y <= std::min(depth.rows - 1, v + kBleedingReach_px); ++y) {
    const auto* depths = depth.ptr<float>(y);
    const auto* labels = ids.ptr<InstanceId>(y);
    for (int x = std::max(0, u - kBleedingReach_px);
         x <= std::min(depth.cols - 1, u + kBleedingReach_px); ++x) {
      if ((y == v && x == u) || labels[x] == kNoInstance || !IsValidDepth(depths[x])) continue;
      (labels[x] == id ? own : others).Add(depths[x]);
    }
  }
  if (own.empty() || others.empty()) return false;
  const float of_own = own.Median();
  const float of_others = others.Median();
  return std::abs(of_own - of_others) > step_m && std::abs(z - of_others) < std::abs(z - of_own);
}

}  // namespace

Expected<BleedingPixels> BleedingPixelsFromName(std::string_view name) {
  if (name == "auto") return BleedingPixels::kAuto;
  if (name == "keep") return BleedingPixels::kKeep;
  if (name == "wait") return BleedingPixels::kWait;
  return UsageError("bleeding '{}' is unknown, expected auto, keep or wait", name);
}

std::string_view BleedingPixelsName(BleedingPixels bleeding) {
  switch (bleeding) {
    case BleedingPixels::kAuto:
      return "auto";
    case BleedingPixels::kKeep:
      return "keep";
    case BleedingPixels::kWait:
      return "wait";
  }
  std::abort();
}

cv::Mat WithoutBleeding(const cv::Mat& depth, const cv::Mat& ids, float step_m) {
  // Where a window has more than one id; most have not.
  const cv::Mat window = cv::Mat::ones(kSide, kSide, CV_8U);
  cv::Mat least;
  cv::Mat most;
  cv::erode(ids, least, window);
  cv::dilate(ids, most, window);
  cv::Mat bleeds(ids.size(), CV_8UC1);
  std::atomic<bool> any = false;
  tbb::parallel_for(
      tbb::blocked_range<int>(0, ids.rows, kRowsPerTask),
      [&](const tbb::blocked_range<int>& range) {
        for (int v = range.begin(); v != range.end(); ++v) {
          const auto* low = least.ptr<InstanceId>(v);
          const auto* high = most.ptr<InstanceId>(v);
          auto* row = bleeds.ptr<std::uint8_t>(v);
          for (int u = 0; u < ids.cols; ++u) {
            row[u] = low[u] != high[u] && Bleeds(depth, ids, v, u, step_m) ? 255 : 0;
            if (row[u] != 0) any.store(true, std::memory_order_relaxed);
          }
        }
      },
      tbb::simple_partitioner());
  if (!any) return ids;
  cv::Mat rest = ids.clone();
  rest.setTo(static_cast<double>(kNoInstance), bleeds);
  return rest;
}

}  // namespace tsdfpp
