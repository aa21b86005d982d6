#include "mapper/track/appearance.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "mapper/track/model_sight.h"

namespace tsdfpp {
namespace {

constexpr int kChroma = 16;  // bins from 0 to 1
constexpr int kBright = 5;   // and from black to white
constexpr double kWithin = 0.8;
// A segment's radius, of its object's: a side can be this much smaller, and, of a model that shows
// but one side, larger.
constexpr double kLeastRadius = 0.35;
constexpr double kMostRadius = 1.8;

double Quantile(std::vector<double>& values, double share) {
  const auto nth =
      values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), nth, values.end());
  return *nth;
}

// A number between bins belongs to both.
struct Spread {
  int bin = 0;
  double upper = 0;
};
Spread SpreadOver(double share, int bins) {
  const double at = std::clamp(share, 0.0, 1.0) * (bins - 1);
  const int bin = std::min(bins - 2, static_cast<int>(at));
  return {bin, at - bin};
}

class Gatherer {
 public:
  void AddColour(const Rgb& colour) {
    if (shares_.empty()) shares_.resize(std::size_t{kChroma} * kChroma * kBright);
    const Chromatic chromatic = ChromaticOf(colour);
    const std::array spreads{SpreadOver(chromatic.first, kChroma),
                             SpreadOver(chromatic.second, kChroma),
                             SpreadOver((chromatic.sum - 3 * kAddedGrey) / (3 * 255), kBright)};
    for (int corner = 0; corner < 8; ++corner) {
      double weight = 1;
      std::array<int, 3> bin{};
      for (std::size_t i = 0; i < 3; ++i) {
        const int up = (corner >> i) & 1;
        bin[i] = spreads[i].bin + up;
        weight *= up != 0 ? spreads[i].upper : 1 - spreads[i].upper;
      }
      shares_[static_cast<std::size_t>((bin[2] * kChroma + bin[1]) * kChroma + bin[0])] +=
          static_cast<float>(weight);
    }
    ++colours_;
  }
  void AddPoint(const Eigen::Vector3d& p) { points_.push_back(p); }

  Appearance Finish() {
    Appearance appearance;
    appearance.points = static_cast<int>(points_.size());
    for (float& share : shares_) share /= static_cast<float>(colours_);
    appearance.colours = std::move(shares_);
    if (points_.empty()) return appearance;
    // Depth at outlines may put some of an object's points on the wall behind it.
    Eigen::Vector3d& middle = appearance.middle;
    std::vector<double> values(points_.size());
    for (int axis = 0; axis < 3; ++axis) {
      for (std::size_t i = 0; i < values.size(); ++i) values[i] = points_[i][axis];
      middle[axis] = Quantile(values, 0.5);
    }
    for (std::size_t i = 0; i < values.size(); ++i) values[i] = (points_[i] - middle).norm();
    appearance.radius_m = Quantile(values, kWithin);
    return appearance;
  }

 private:
  std::vector<float> shares_;
  int colours_ = 0;
  std::vector<Eigen::Vector3d> points_;
};

}  // namespace

Rgb RgbOf(const cv::Vec3b& pixel) {
  return {static_cast<double>(pixel[0]), static_cast<double>(pixel[1]),
          static_cast<double>(pixel[2])};
}

Chromatic ChromaticOf(const Rgb& colour) {
  const double sum = colour[0] + colour[1] + colour[2] + 3 * kAddedGrey;
  return {(colour[0] + kAddedGrey) / sum, (colour[1] + kAddedGrey) / sum, sum};
}

Appearance AppearanceOf(const Frame& frame, const std::vector<SegmentPoint>& points) {
  Gatherer gatherer;
  for (const SegmentPoint& point : points) {
    gatherer.AddPoint(point.p_C.cast<double>());
    if (frame.colour.empty()) continue;
    const auto& pixel = frame.colour.at<cv::Vec3b>(point.pixel);
    gatherer.AddColour(RgbOf(pixel));
  }
  return gatherer.Finish();
}

Appearance AppearanceOf(const TsdfGrid& model, double voxel_m) {
  Gatherer gatherer;
  for (const auto* entry : model.Sorted()) {
    ForEachSurfaceVoxel(*entry, voxel_m, [&](std::size_t place, const Index3& v) {
      gatherer.AddPoint(voxel_m * Eigen::Vector3d(v.x, v.y, v.z));
      if (entry->block->ColourCount(place) == 0) return;
      const FixedColour fixed = entry->block->FixedColourAt(place);
      gatherer.AddColour({fixed[0] / 256.0, fixed[1] / 256.0, fixed[2] / 256.0});
    });
  }
  return gatherer.Finish();
}

double ColoursInCommon(const Appearance& a, const Appearance& b) {
  if (a.colours.empty() || b.colours.empty()) return 1;
  double common = 0;
  for (std::size_t i = 0; i < a.colours.size(); ++i) {
    common += double{std::min(a.colours[i], b.colours[i])};
  }
  return common;
}

bool IsOfSize(const Appearance& segment, const Appearance& model, double voxel_m) {
  return segment.radius_m >= kLeastRadius * model.radius_m - voxel_m &&
         segment.radius_m <= kMostRadius * model.radius_m + voxel_m;
}

}  // namespace tsdfpp
