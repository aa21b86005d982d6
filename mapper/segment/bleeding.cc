#include "mapper/segment/bleeding.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstddef>
#include <cstdlib>

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

// What a pixel says of the camera.
enum class Verdict : std::uint8_t {
  kNothing,
  kHolds,  // beside a step in depth along an outline, with the depth of its own side ...
  kBleeds  // ... or with that of the other
};

struct Judged {
  Verdict verdict = Verdict::kNothing;
  bool is_stray = false;
};

Judged Judge(const cv::Mat& depth, const cv::Mat& ids, int v, int u, float step_m) {
  const InstanceId id = ids.at<InstanceId>(v, u);
  const float z = depth.at<float>(v, u);
  if (id == kNoInstance || !IsValidDepth(z)) return {};
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
  if (own.empty() || others.empty()) return {};
  const float of_own = own.Median();
  const float of_others = others.Median();
  const float from_own = std::abs(z - of_own);
  // Where a thing is thin, most of its pixels may have the depth behind it: what is nearer is
  // right.
  const bool is_stray = z - of_own > kStray_steps * step_m;
  if (!(std::abs(of_own - of_others) > step_m)) return {Verdict::kNothing, is_stray};
  return {std::abs(z - of_others) < from_own ? Verdict::kBleeds : Verdict::kHolds, is_stray};
}

// 255 at all pixels whose windows have more than one id, and at some beside them; most have one.
cv::Mat NearOutlines(const cv::Mat& ids) {
  cv::Mat near(ids.size(), CV_8UC1, cv::Scalar(0));
  for (int v = 0; v < ids.rows; ++v) {
    const auto* row = ids.ptr<InstanceId>(v);
    const auto* below = ids.ptr<InstanceId>(std::min(v + 1, ids.rows - 1));
    for (int u = 0; u < ids.cols; ++u) {
      const bool differs = row[u] != below[u] || (u + 1 < ids.cols && row[u] != row[u + 1]);
      if (!differs) continue;
      const int left = std::max(0, u - kBleedingReach_px);
      const int right = std::min(ids.cols - 1, u + kBleedingReach_px);
      for (int y = std::max(0, v - kBleedingReach_px);
           y <= std::min(ids.rows - 1, v + kBleedingReach_px); ++y) {
        auto* to = near.ptr<std::uint8_t>(y);
        std::fill(to + left, to + right + 1, std::uint8_t{255});
      }
    }
  }
  return near;
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
  const cv::Mat near = NearOutlines(ids);
  cv::Mat bleeds(ids.size(), CV_8UC1, cv::Scalar(0));
  std::atomic<std::int64_t> beside_steps = 0;
  std::atomic<std::int64_t> bleeding = 0;
  tbb::parallel_for(
      tbb::blocked_range<int>(0, ids.rows, kRowsPerTask),
      [&](const tbb::blocked_range<int>& range) {
        std::array<std::int64_t, 3> counts{};
        for (int v = range.begin(); v != range.end(); ++v) {
          const auto* is_near = near.ptr<std::uint8_t>(v);
          auto* row = bleeds.ptr<std::uint8_t>(v);
          for (int u = 0; u < ids.cols; ++u) {
            if (is_near[u] == 0) continue;
            const Judged judged = Judge(depth, ids, v, u, step_m);
            ++counts[static_cast<std::size_t>(judged.verdict)];
            if (judged.verdict == Verdict::kBleeds || judged.is_stray) row[u] = 255;
          }
        }
        const std::int64_t bleed = counts[static_cast<std::size_t>(Verdict::kBleeds)];
        beside_steps += bleed + counts[static_cast<std::size_t>(Verdict::kHolds)];
        bleeding += bleed;
      },
      tbb::simple_partitioner());
  const auto least = kLeastBleedingShare * static_cast<double>(beside_steps);
  if (bleeding == 0 || static_cast<double>(bleeding) < least) return ids;
  cv::Mat rest = ids.clone();
  rest.setTo(static_cast<double>(kNoInstance), bleeds);
  return rest;
}

}  // namespace tsdfpp
