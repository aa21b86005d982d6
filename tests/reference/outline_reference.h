// Labels beside outlines as mapper/associate/outline_surfaces.h says, pixel by pixel in double
// precision, with nothing kept from one pixel to the next.
#pragma once

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <vector>

#include "mapper/associate/outline_surfaces.h"

namespace tsdfpp::reference {

struct OutlineVerdict {
  InstanceId label = kNoInstance;
  bool is_doubtful = false;
  // How near the decision was, as the least ratio of what was compared; 1 is a tie.
  double margin = 1e9;
};

class OutlineReference {
 public:
  OutlineReference(const SurfaceMaps& maps, const cv::Mat& depth, const cv::Mat& labels,
                   double step_m)
      : maps_(maps), depth_(depth), labels_(labels), step_m_(step_m) {}

  OutlineVerdict Of(int v, int u) const {
    const InstanceId own = LabelAt(v, u);
    OutlineVerdict verdict{own, false, 1e9};
    if (own == kNoInstance || !IsValidDepth(depth_.at<float>(v, u)) || IsInner(v, u)) {
      return verdict;
    }
    std::map<InstanceId, std::vector<double>> sides;
    ForEachNear(v, u, 2 * kOutlineReach_px, [&](int y, int x) {
      if (LabelAt(y, x) == kNoInstance || !IsInner(y, x)) return;
      const auto z = PlaneDepth(y, x, v, u);
      if (z) sides[LabelAt(y, x)].push_back(std::abs(*z - depth_.at<float>(v, u)));
    });
    std::optional<double> from_own;
    std::optional<std::pair<double, InstanceId>> from_other;
    for (auto& [label, distances] : sides) {
      if (distances.size() < kLeastOnASide) continue;
      std::sort(distances.begin(), distances.end());
      const auto quantile =
          static_cast<std::size_t>(kOwnQuantile * static_cast<double>(distances.size()));
      const double eighth = distances[kLeastOnASide - 1];
      if (label == own) {
        from_own = std::max(eighth, distances[quantile]);
      } else if (!from_other || eighth < from_other->first) {
        from_other = {eighth, label};
      }
    }
    if (!from_own || !from_other) return verdict;
    const double least = std::max<double>(step_m_, kOutlineSigmas * maps_.sigma.at<float>(v, u));
    verdict.margin = Ratio(*from_own, least);
    if (*from_own <= least) return verdict;
    verdict.margin = std::min(verdict.margin, Ratio(*from_own, kTimesNearer * from_other->first));
    if (*from_own > kTimesNearer * from_other->first) {
      verdict.margin = std::min(verdict.margin, Ratio(from_other->first, least));
      verdict.label = from_other->second;
      verdict.is_doubtful = from_other->first > least;
    } else {
      verdict.margin = std::min(verdict.margin, Ratio(*from_own, from_other->first));
      verdict.is_doubtful = *from_own > from_other->first;
    }
    return verdict;
  }

 private:
  static double Ratio(double a, double b) { return std::max(a, b) / std::min(a, b); }
  InstanceId LabelAt(int v, int u) const { return labels_.at<InstanceId>(v, u); }

  template <typename Of>
  void ForEachNear(int v, int u, int reach, const Of& of) const {
    for (int y = v - reach; y <= v + reach; ++y) {
      for (int x = u - reach; x <= u + reach; ++x) {
        if (y >= 0 && x >= 0 && y < labels_.rows && x < labels_.cols) of(y, x);
      }
    }
  }

  bool IsInner(int v, int u) const {
    std::optional<InstanceId> first;
    bool is_inner = true;
    ForEachNear(v, u, kOutlineReach_px, [&](int y, int x) {
      if (LabelAt(y, x) == kNoInstance) return;
      if (!first) first = LabelAt(y, x);
      is_inner = is_inner && *first == LabelAt(y, x);
    });
    return is_inner;
  }

  std::optional<double> PlaneDepth(int y, int x, int v, int u) const {
    const auto& n = maps_.normal.at<cv::Vec3f>(y, x);
    const auto along = [&](int row, int column) {
      return double{n[0]} * maps_.rays.x[static_cast<std::size_t>(column)] +
             double{n[1]} * maps_.rays.y[static_cast<std::size_t>(row)] + n[2];
    };
    const double z = maps_.depth.at<float>(y, x) * along(y, x) / along(v, u);
    return std::isfinite(z) && z > 0 ? std::optional(z) : std::nullopt;
  }

  const SurfaceMaps& maps_;
  const cv::Mat& depth_;
  const cv::Mat& labels_;
  double step_m_;
};

}  // namespace tsdfpp::reference
