#include "mapper/segment/background.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

namespace tsdfpp {
namespace {

constexpr double kLargeShare = 0.5;
constexpr double kWithinShare = 0.9;
constexpr float kOff = 2;  // times PlaneSample::near
// A wall, where little of it is seen: the room ends there, so next to nothing lies behind it.
constexpr double kWall_m2 = 0.005;
constexpr double kWallShare = 0.8;
constexpr double kBehindShare = 0.05;
constexpr int kThinning = 16;  // of the samples that are asked whether they are behind

// Of the labels that may be walls, those with little of the frame behind them.
std::vector<std::size_t> FindWalls(const SurfaceMaps& maps, const cv::Mat& labels,
                                   const std::vector<InversePlane>& fitted,
                                   const std::vector<SegmentPlane>& planes,
                                   const DepthSegmentsConfig& config) {
  std::vector<std::size_t> candidates;
  for (std::size_t label = 1; label < planes.size(); ++label) {
    const SegmentPlane& plane = planes[label];
    if (plane.is_plane && plane.area_m2 >= kWall_m2 && plane.on_share >= kWallShare) {
      candidates.push_back(label);
    }
  }
  std::vector<double> behind(candidates.size());
  double all = 0;
  int count = 0;
  const cv::Range all_rows(0, (labels.rows + kSampleStride - 1) / kSampleStride);
  ForEachPlaneSample(maps, labels, config, all_rows, [&](std::int32_t, const auto& sample) {
    if (count++ % kThinning != 0) return;
    all += 1;
    const PlaneSample s = sample();
    for (std::size_t i = 0; i < candidates.size(); ++i) {
      if (fitted[candidates[i]].Off(s) > kOff * double{s.near}) behind[i] += 1;
    }
  });
  std::vector<std::size_t> walls;
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    if (behind[i] <= kBehindShare * all) walls.push_back(candidates[i]);
  }
  return walls;
}

// Whether nine tenths of each label's samples are near one of the large planes; not asked of those
// that are large themselves. A byte a label, as threads write them side by side.
std::vector<std::uint8_t> FindWithin(const SamplesByLabel& samples,
                                     const std::vector<InversePlane>& fitted,
                                     const std::vector<bool>& is_large) {
  std::vector<std::size_t> large;
  for (std::size_t label = 0; label < is_large.size(); ++label) {
    if (is_large[label]) large.push_back(label);
  }
  std::vector<std::uint8_t> is_within(fitted.size());
  samples.ForEachLabel([&](std::size_t label) {
    const std::span<const PlaneSample> of_label = samples.Of(label);
    if (label == 0 || of_label.empty() || is_large[label]) return;
    const double enough = kWithinShare * static_cast<double>(of_label.size());
    for (const std::size_t plane : large) {
      std::size_t left = of_label.size();  // those that are near, or not asked yet
      for (const PlaneSample& s : of_label) {
        if (fitted[plane].IsNear(s)) continue;
        if (static_cast<double>(--left) < enough) break;
      }
      if (static_cast<double>(left) >= enough) is_within[label] = 1;
    }
  });
  return is_within;
}

}  // namespace

std::int32_t BackgroundParter::Part(const SurfaceMaps& maps, const PixelLinks& links,
                                    const PartSize& least, std::int32_t end,
                                    const DepthSegmentsConfig& config, cv::Mat& labels) {
  samples_.Take(maps, labels, end, config);
  const std::vector<InversePlane> fitted = FitInversePlanes(samples_);
  const std::vector<SegmentPlane> planes = MeasurePlanes(maps, samples_, fitted);
  std::vector<bool> is_large(planes.size());
  for (std::size_t label = 1; label < planes.size(); ++label) {
    const SegmentPlane& plane = planes[label];
    is_large[label] =
        plane.is_plane && plane.area_m2 >= config.plane_m2 && plane.on_share >= kLargeShare;
  }
  for (const std::size_t label : FindWalls(maps, labels, fitted, planes, config)) {
    is_large[label] = true;
  }
  if (std::find(is_large.begin(), is_large.end(), true) == is_large.end()) return end;
  const std::vector<std::uint8_t> is_within = FindWithin(samples_, fitted, is_large);
  const NearScale near(maps, config);
  off_.create(labels.size(), CV_8UC1);
  ForEachRow(labels.rows, [&](int v) {
    auto* row = labels.ptr<std::int32_t>(v);
    auto* is_off = off_.ptr<std::uint8_t>(v);
    const auto* q = maps.inverse_depth.ptr<float>(v);
    const auto* sigma = maps.sigma.ptr<float>(v);
    const float* x = maps.rays.x.data();
    const float y = maps.rays.y[static_cast<std::size_t>(v)];
    std::fill(is_off, is_off + labels.cols, std::uint8_t{0});
    for (int begin = 0; begin < labels.cols;) {
      // Runs of one label are long.
      const auto label = static_cast<std::size_t>(row[begin]);
      int end_of_run = begin + 1;
      while (end_of_run < labels.cols && row[end_of_run] == row[begin]) ++end_of_run;
      if (label != 0 && (is_large[label] || is_within[label] != 0)) {
        std::fill(row + begin, row + end_of_run, kBackgroundLabel);
        if (is_large[label]) {
          const auto a = static_cast<float>(fitted[label].a);
          const auto bc = static_cast<float>(fitted[label].b * double{y} + fitted[label].c);
          for (int u = begin; u < end_of_run; ++u) {
            const float distance = std::abs(a * x[u] + bc - q[u]);
            is_off[u] = distance > kOff * near.Of(q[u], sigma[u]) ? 255 : 0;
          }
        }
      }
      begin = end_of_run;
    }
  });
  const std::int32_t first = end;
  const std::int32_t parts_end = LabelComponents(off_, links, first, labels);
  const std::vector<PartSize> sizes =
      MeasureParts(labels, maps.depth, maps.rays.pixel_width, parts_end);
  std::vector<std::int32_t> label_of;  // of the parts
  for (auto part = static_cast<std::size_t>(first); part < sizes.size(); ++part) {
    const bool is_small = sizes[part].pixels < least.pixels || sizes[part].area_m2 < least.area_m2;
    label_of.push_back(is_small ? kBackgroundLabel : end++);
  }
  ForEachRow(labels.rows, [&](int v) {
    auto* row = labels.ptr<std::int32_t>(v);
    for (int u = 0; u < labels.cols; ++u) {
      if (row[u] >= first) row[u] = label_of[static_cast<std::size_t>(row[u] - first)];
    }
  });
  return end;
}

}  // namespace tsdfpp
