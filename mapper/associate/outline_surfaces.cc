#include "mapper/associate/outline_surfaces.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <vector>

namespace tsdfpp {
namespace {

constexpr int kWindow_px = 2 * kOutlineReach_px;

// The least and the greatest of some labels, kNoInstance aside.
struct LabelRange {
  InstanceId least = kNoInstance;
  InstanceId greatest = 0;
  void Add(InstanceId label) {
    if (label == kNoInstance) return;
    least = std::min(least, label);
    greatest = std::max(greatest, label);
  }
  void Add(const LabelRange& other) {
    least = std::min(least, other.least);
    greatest = std::max(greatest, other.greatest);
  }
  bool IsOne() const { return least >= greatest; }
};

// 255 where all labels within kOutlineReach_px are one, kNoInstance aside.
cv::Mat InnerPixels(const cv::Mat& labels) {
  const auto place = [&](int v, int u) {
    return static_cast<std::size_t>(v) * static_cast<std::size_t>(labels.cols) +
           static_cast<std::size_t>(u);
  };
  // Of a row's window, then of those of a column's.
  std::vector<LabelRange> of_rows(labels.total());
  ForEachRow(labels.rows, [&](int v) {
    const auto* row = labels.ptr<InstanceId>(v);
    for (int u = 0; u < labels.cols; ++u) {
      LabelRange& range = of_rows[place(v, u)];
      for (int x = std::max(0, u - kOutlineReach_px);
           x <= std::min(labels.cols - 1, u + kOutlineReach_px); ++x) {
        range.Add(row[x]);
      }
    }
  });
  cv::Mat inner(labels.size(), CV_8UC1);
  ForEachRow(labels.rows, [&](int v) {
    auto* row = inner.ptr<std::uint8_t>(v);
    for (int u = 0; u < labels.cols; ++u) {
      LabelRange range;
      for (int y = std::max(0, v - kOutlineReach_px);
           y <= std::min(labels.rows - 1, v + kOutlineReach_px); ++y) {
        range.Add(of_rows[place(y, u)]);
      }
      row[u] = range.IsOne() ? 255 : 0;
    }
  });
  return inner;
}

// The distances of a pixel's point from the surface that the points of one label about it are on.
struct Side {
  InstanceId label = kNoInstance;
  std::vector<float> distances;
};

class Outlines {
 public:
  Outlines(const SurfaceMaps& maps, const cv::Mat& depth, const cv::Mat& labels, float step_m)
      : maps_(maps), depth_(depth), labels_(labels), inner_(InnerPixels(labels)), step_m_(step_m) {}

  struct Verdict {
    InstanceId label = kNoInstance;
    bool is_doubtful = false;
  };
  // `sides` is memory.
  Verdict Of(int v, int u, std::vector<Side>& sides) const {
    const InstanceId own = labels_.at<InstanceId>(v, u);
    const bool is_beside = inner_.at<std::uint8_t>(v, u) == 0 && own != kNoInstance &&
                           IsValidDepth(depth_.at<float>(v, u));
    if (!is_beside) return {own, false};
    FindSides(v, u, sides);
    std::optional<float> from_own;
    std::optional<float> from_other;
    InstanceId other = own;
    for (Side& side : sides) {
      if (side.distances.size() < kLeastOnASide) continue;
      const float distance = DistanceFrom(side, side.label == own);
      if (side.label == own) {
        from_own = distance;
      } else if (!from_other || distance < *from_other ||
                 (distance == *from_other && side.label < other)) {
        from_other = distance;
        other = side.label;
      }
    }
    const float least = std::max(step_m_, kOutlineSigmas * maps_.sigma.at<float>(v, u));
    if (!from_own || !from_other || *from_own <= least) return {own, false};
    const bool is_others = *from_own > kTimesNearer * *from_other;
    if (is_others) return {other, *from_other > least};
    return {own, *from_own > *from_other};
  }

 private:
  static float DistanceFrom(Side& side, bool is_own) {
    auto place = static_cast<std::ptrdiff_t>(kLeastOnASide - 1);
    if (is_own) {
      place = std::max(place, static_cast<std::ptrdiff_t>(
                                  kOwnQuantile * static_cast<double>(side.distances.size())));
    }
    std::nth_element(side.distances.begin(), side.distances.begin() + place, side.distances.end());
    return side.distances[static_cast<std::size_t>(place)];
  }

  void FindSides(int v, int u, std::vector<Side>& sides) const {
    std::size_t count = 0;
    const float z = depth_.at<float>(v, u);
    for (int y = std::max(0, v - kWindow_px); y <= std::min(labels_.rows - 1, v + kWindow_px);
         ++y) {
      for (int x = std::max(0, u - kWindow_px); x <= std::min(labels_.cols - 1, u + kWindow_px);
           ++x) {
        const InstanceId label = labels_.at<InstanceId>(y, x);
        if (label == kNoInstance || inner_.at<std::uint8_t>(y, x) == 0) continue;
        const std::optional<float> there = DepthOfPlane(y, x, v, u);
        if (!there) continue;
        std::size_t i = 0;
        while (i < count && sides[i].label != label) ++i;
        if (i == count) {
          if (count == sides.size()) sides.emplace_back();
          sides[count].label = label;
          sides[count].distances.clear();
          ++count;
        }
        sides[i].distances.push_back(std::abs(*there - z));
      }
    }
    sides.resize(count);
  }

  // Where the ray of (u, v) meets the tangent plane of the surface at (x, y); nothing where it does
  // not, or there is no surface.
  std::optional<float> DepthOfPlane(int y, int x, int v, int u) const {
    const auto& n = maps_.normal.at<cv::Vec3f>(y, x);
    const auto at = [](int w) { return static_cast<std::size_t>(w); };
    const float of_ray = n[0] * maps_.rays.x[at(u)] + n[1] * maps_.rays.y[at(v)] + n[2];
    const float of_point = n[0] * maps_.rays.x[at(x)] + n[1] * maps_.rays.y[at(y)] + n[2];
    const float z = maps_.depth.at<float>(y, x) * of_point / of_ray;
    if (!(z > 0) || !std::isfinite(z)) return std::nullopt;
    return z;
  }

  const SurfaceMaps& maps_;
  const cv::Mat& depth_;
  const cv::Mat& labels_;
  cv::Mat inner_;
  float step_m_;
};

}  // namespace

OutlineLabels LabelsByOutline(const SurfaceMaps& maps, const cv::Mat& depth, const cv::Mat& labels,
                              float step_m) {
  const Outlines outlines(maps, depth, labels, step_m);
  OutlineLabels result{cv::Mat(labels.size(), CV_16UC1), cv::Mat(labels.size(), CV_8UC1)};
  ForEachRow(labels.rows, [&](int v) {
    auto* to = result.labels.ptr<InstanceId>(v);
    auto* is_doubtful = result.is_doubtful.ptr<std::uint8_t>(v);
    std::vector<Side> sides;
    for (int u = 0; u < labels.cols; ++u) {
      const Outlines::Verdict verdict = outlines.Of(v, u, sides);
      to[u] = verdict.label;
      is_doubtful[u] = verdict.is_doubtful ? 255 : 0;
    }
  });
  return result;
}

}  // namespace tsdfpp
