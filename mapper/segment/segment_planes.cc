#include "mapper/segment/segment_planes.h"

#include <Eigen/Cholesky>
#include <array>
#include <cstddef>
#include <limits>
#include <utility>

namespace tsdfpp {
namespace {

// Fewer samples do not make a plane.
constexpr double kLeastSamples = 8;

// Normal equations of q = a x + b y + c.
struct PlaneSums {
  double n = 0, x = 0, y = 0, q = 0, xx = 0, xy = 0, yy = 0, xq = 0, yq = 0;

  void Add(const PlaneSample& s) {
    const double sx = s.x;
    const double sy = s.y;
    const double sq = s.q;
    n += 1;
    x += sx;
    y += sy;
    q += sq;
    xx += sx * sx;
    xy += sx * sy;
    yy += sy * sy;
    xq += sx * sq;
    yq += sy * sq;
  }
  PlaneSums& operator+=(const PlaneSums& other) {
    n += other.n;
    x += other.x;
    y += other.y;
    q += other.q;
    xx += other.xx;
    xy += other.xy;
    yy += other.yy;
    xq += other.xq;
    yq += other.yq;
    return *this;
  }
};

struct NearSums {
  double count = 0;
  double area = 0;  // of pixels as large as 1
  NearSums& operator+=(const NearSums& other) {
    count += other.count;
    area += other.area;
    return *this;
  }
};

InversePlane Solve(const PlaneSums& sums) {
  InversePlane plane;
  if (sums.n < kLeastSamples) return plane;
  Eigen::Matrix3d equations;
  equations << sums.xx, sums.xy, sums.x, sums.xy, sums.yy, sums.y, sums.x, sums.y, sums.n;
  const Eigen::Vector3d abc = equations.ldlt().solve(Eigen::Vector3d(sums.xq, sums.yq, sums.q));
  if (!abc.allFinite() || !(abc.norm() > 0)) return plane;
  return {abc.x(), abc.y(), abc.z(), true};
}

}  // namespace

void SamplesByLabel::Take(const SurfaceMaps& maps, const cv::Mat& labels, std::int32_t end,
                          const DepthSegmentsConfig& config) {
  const int rows = (labels.rows + kSampleStride - 1) / kSampleStride;
  // By strip and label: how many, then where the next one goes.
  std::array<std::vector<std::size_t>, kRowStrips> next;
  ForEachStrip(rows, [&](std::size_t strip, int first, int last) {
    auto& count = next[strip];
    count.assign(static_cast<std::size_t>(end), 0);
    ForEachPlaneSample(maps, labels, config, {first, last}, [&](std::int32_t label, const auto&) {
      ++count[static_cast<std::size_t>(label)];
    });
  });
  begin_.assign(static_cast<std::size_t>(end) + 1, 0);
  std::size_t count = 0;
  for (std::size_t label = 0; label < this->labels(); ++label) {
    begin_[label] = count;
    for (auto& counts : next) count += std::exchange(counts[label], count);
  }
  begin_.back() = count;
  samples_.resize(count);
  ForEachStrip(rows, [&](std::size_t strip, int first, int last) {
    auto& to = next[strip];
    ForEachPlaneSample(maps, labels, config, {first, last},
                       [&](std::int32_t label, const auto& sample) {
                         samples_[to[static_cast<std::size_t>(label)]++] = sample();
                       });
  });
}

std::vector<InversePlane> FitInversePlanes(const SamplesByLabel& samples) {
  std::vector<InversePlane> planes(samples.labels());
  samples.ForEachLabel([&](std::size_t label) {
    InversePlane& plane = planes[label];
    for (const double within : {std::numeric_limits<double>::infinity(), 8.0, 4.0, 2.0, 1.0, 1.0}) {
      plane = Solve(samples.SumOver(label, [&](std::span<const PlaneSample> part) {
        PlaneSums sums;
        for (const PlaneSample& s : part) {
          if (!std::isfinite(within) || plane.IsNear(s, within)) sums.Add(s);
        }
        return sums;
      }));
      if (!plane.is_solved) return;
    }
  });
  return planes;
}

std::vector<SegmentPlane> MeasurePlanes(const SurfaceMaps& maps, const SamplesByLabel& samples,
                                        const std::vector<InversePlane>& fitted) {
  constexpr double kLeastCosine = 0.05;
  const double pixel_area =
      kSampleStride * kSampleStride / double{maps.rays.per_x} / double{maps.rays.per_y};
  std::vector<SegmentPlane> planes(fitted.size());
  samples.ForEachLabel([&](std::size_t label) {
    const InversePlane& plane = fitted[label];
    if (!plane.is_solved) return;
    const double per_length = 1 / std::hypot(plane.a, plane.b, plane.c);
    const NearSums near = samples.SumOver(label, [&](std::span<const PlaneSample> part) {
      NearSums sums;
      for (const PlaneSample& s : part) {
        if (!plane.IsNear(s)) continue;
        const double facing =
            (plane.a * double{s.x} + plane.b * double{s.y} + plane.c) * per_length;
        sums += {1, 1 / (double{s.q} * double{s.q} * std::max(facing, kLeastCosine))};
      }
      return sums;
    });
    planes[label] = {true, pixel_area * near.area,
                     near.count / static_cast<double>(samples.Of(label).size())};
  });
  return planes;
}

}  // namespace tsdfpp
