#include "mapper/segment/bleeding.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <vector>

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
  // Of an even number the upper one. There must be one. The numbers are few: to count for each how
  // many are less takes no branches.
  float Median() const {
    const int middle = count_ / 2;
    for (int i = 0; i < count_; ++i) {
      int less = 0;
      int no_more = 0;
      for (int k = 0; k < count_; ++k) {
        less += values_[k] < values_[i] ? 1 : 0;
        no_more += values_[k] <= values_[i] ? 1 : 0;
      }
      if (less <= middle && middle < no_more) return values_[i];
    }
    std::abort();  // NaN, which is no valid depth
  }

 private:
  std::array<float, std::size_t{kSide} * kSide> values_;
  int count_ = 0;
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
  float nearest = z;
  float farthest = z;
  for (int y = std::max(0, v - kBleedingReach_px);
       y <= std::min(depth.rows - 1, v + kBleedingReach_px); ++y) {
    const auto* depths = depth.ptr<float>(y);
    const auto* labels = ids.ptr<InstanceId>(y);
    for (int x = std::max(0, u - kBleedingReach_px);
         x <= std::min(depth.cols - 1, u + kBleedingReach_px); ++x) {
      if ((y == v && x == u) || labels[x] == kNoInstance || !IsValidDepth(depths[x])) continue;
      (labels[x] == id ? own : others).Add(depths[x]);
      nearest = std::min(nearest, depths[x]);
      farthest = std::max(farthest, depths[x]);
    }
  }
  // Most outlines are no steps; no two medians of these depths are more apart than all of them.
  if (own.empty() || others.empty() || !(farthest - nearest > step_m)) return {};
  const float of_own = own.Median();
  const float of_others = others.Median();
  const float from_own = std::abs(z - of_own);
  // Where a thing is thin, most of its pixels may have the depth behind it: what is nearer is
  // right.
  const bool is_stray = z - of_own > kStray_steps * step_m;
  if (!(std::abs(of_own - of_others) > step_m)) return {Verdict::kNothing, is_stray};
  return {std::abs(z - of_others) < from_own ? Verdict::kBleeds : Verdict::kHolds, is_stray};
}

template <typename Rows>
void ForRows(int rows, const Rows& of) {
  tbb::parallel_for(tbb::blocked_range<int>(0, rows, kRowsPerTask), of, tbb::simple_partitioner());
}

// 255 where in this row, within kBleedingReach_px columns, a pixel has another id than the one on
// its right or the one below it.
cv::Mat BesideOutlines(const cv::Mat& ids) {
  cv::Mat beside(ids.size(), CV_8UC1, cv::Scalar(0));
  ForRows(ids.rows, [&](const tbb::blocked_range<int>& range) {
    for (int v = range.begin(); v != range.end(); ++v) {
      const auto* row = ids.ptr<InstanceId>(v);
      const auto* below = ids.ptr<InstanceId>(std::min(v + 1, ids.rows - 1));
      auto* to = beside.ptr<std::uint8_t>(v);
      for (int u = 0; u < ids.cols; ++u) {
        const bool differs = row[u] != below[u] || (u + 1 < ids.cols && row[u] != row[u + 1]);
        if (!differs) continue;
        std::fill(to + std::max(0, u - kBleedingReach_px),
                  to + std::min(ids.cols, u + kBleedingReach_px + 1), std::uint8_t{255});
      }
    }
  });
  return beside;
}

// Not 0 at all pixels of row `v` whose windows have more than one id, and at some beside them; most
// have one.
void NearOutlines(const cv::Mat& beside, int v, std::vector<std::uint8_t>& near) {
  near.assign(static_cast<std::size_t>(beside.cols), 0);
  for (int y = std::max(0, v - kBleedingReach_px);
       y <= std::min(beside.rows - 1, v + kBleedingReach_px); ++y) {
    const auto* row = beside.ptr<std::uint8_t>(y);
    for (std::size_t u = 0; u < near.size(); ++u) near[u] |= row[u];
  }
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
  const cv::Mat beside = BesideOutlines(ids);
  cv::Mat bleeds(ids.size(), CV_8UC1, cv::Scalar(0));
  std::atomic<std::int64_t> beside_steps = 0;
  std::atomic<std::int64_t> bleeding = 0;
  ForRows(ids.rows, [&](const tbb::blocked_range<int>& range) {
    std::array<std::int64_t, 3> counts{};
    std::vector<std::uint8_t> is_near;
    for (int v = range.begin(); v != range.end(); ++v) {
      NearOutlines(beside, v, is_near);
      auto* row = bleeds.ptr<std::uint8_t>(v);
      for (int u = 0; u < ids.cols; ++u) {
        if (is_near[static_cast<std::size_t>(u)] == 0) continue;
        const Judged judged = Judge(depth, ids, v, u, step_m);
        ++counts[static_cast<std::size_t>(judged.verdict)];
        if (judged.verdict == Verdict::kBleeds || judged.is_stray) row[u] = 255;
      }
    }
    const std::int64_t bleed = counts[static_cast<std::size_t>(Verdict::kBleeds)];
    beside_steps += bleed + counts[static_cast<std::size_t>(Verdict::kHolds)];
    bleeding += bleed;
  });
  const auto least = kLeastBleedingShare * static_cast<double>(beside_steps);
  if (bleeding == 0 || static_cast<double>(bleeding) < least) return ids;
  cv::Mat rest = ids.clone();
  rest.setTo(static_cast<double>(kNoInstance), bleeds);
  return rest;
}

}  // namespace tsdfpp
