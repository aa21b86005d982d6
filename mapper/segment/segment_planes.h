// The planes of a frame's segments, fitted to samples of their pixels.
#pragma once

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <opencv2/core.hpp>
#include <span>
#include <vector>

#include "mapper/segment/pixel_rays.h"
#include "mapper/segment/surface_maps.h"

namespace tsdfpp {

// What is near a plane: what its noise and a pixel's width may part from it, as inverse depth.
struct NearScale {
  float per_sigma = 0;
  float pixel_width = 0;

  NearScale(const SurfaceMaps& maps, const DepthSegmentsConfig& config)
      : per_sigma(static_cast<float>(config.sigmas)), pixel_width(maps.rays.pixel_width) {}
  // Of a pixel with inverse depth q and noise sigma along its ray, m: 1/m.
  float Of(float q, float sigma) const { return (per_sigma * sigma * q + pixel_width) * q; }
};

struct PlaneSample {
  float x = 0;  // the ray is (x, y, 1)
  float y = 0;
  float q = 0;     // inverse depth
  float near = 0;  // NearScale
};

// Calls of_sample(label, sample), where sample() is the PlaneSample, for every second row's every
// second pixel that has a label and a depth, in order of rows. `rows` are some of these second
// rows.
template <typename OfSample>
void ForEachPlaneSample(const SurfaceMaps& maps, const cv::Mat& labels,
                        const DepthSegmentsConfig& config, const cv::Range& rows,
                        const OfSample& of_sample);
inline constexpr int kSampleStride = 2;

// The samples of one frame by label, each label's by rows.
class SamplesByLabel {
 public:
  // In place of those that it has, whose memory it keeps. Labels are below `end`; 0 has no samples.
  void Take(const SurfaceMaps& maps, const cv::Mat& labels, std::int32_t end,
            const DepthSegmentsConfig& config);

  std::size_t labels() const { return begin_.size() - 1; }
  std::span<const PlaneSample> Of(std::size_t label) const {
    return std::span(samples_).subspan(begin_[label], begin_[label + 1] - begin_[label]);
  }

  // Calls of_label(label) for each, in parallel.
  template <typename OfLabel>
  void ForEachLabel(const OfLabel& of_label) const {
    tbb::parallel_for(std::size_t{0}, labels(), of_label);
  }

  // The sum (+=) of what of_samples(samples) says of parts of a label's samples, in parallel. The
  // parts are the same for any number of threads, and so is the sum.
  template <typename OfSamples>
  auto SumOver(std::size_t label, const OfSamples& of_samples) const;

 private:
  std::vector<std::size_t> begin_{0};  // by label, and the end of the last
  std::vector<PlaneSample> samples_;
};

// q = a x + b y + c.
struct InversePlane {
  double a = 0, b = 0, c = 0;
  bool is_solved = false;

  // Inverse depth of the plane less that of the sample: positive where the sample lies behind it.
  double Off(const PlaneSample& s) const {
    return a * double{s.x} + b * double{s.y} + c - double{s.q};
  }
  bool IsNear(const PlaneSample& s, double times = 1) const {
    return std::abs(Off(s)) <= times * double{s.near};
  }
};

// The plane of each label: least squares of inverse depth over all its samples, then over those
// near the plane before, within eight, four, two, one and one times PlaneSample::near.
std::vector<InversePlane> FitInversePlanes(const SamplesByLabel& samples);

// What a segment has of its plane.
struct SegmentPlane {
  bool is_plane = false;  // the rest means nothing where false
  double area_m2 = 0;     // on the plane, of the segment's pixels that are near it
  double on_share = 0;    // of the segment's pixels, that are near it
};

// By label. A plane that is seen from its side counts as if it were seen at a cosine of 0.05.
std::vector<SegmentPlane> MeasurePlanes(const SurfaceMaps& maps, const SamplesByLabel& samples,
                                        const std::vector<InversePlane>& fitted);

template <typename OfSample>
void ForEachPlaneSample(const SurfaceMaps& maps, const cv::Mat& labels,
                        const DepthSegmentsConfig& config, const cv::Range& rows,
                        const OfSample& of_sample) {
  const NearScale near(maps, config);
  const int last = std::min(labels.rows, kSampleStride * rows.end);
  for (int v = kSampleStride * rows.start; v < last; v += kSampleStride) {
    const auto* label = labels.ptr<std::int32_t>(v);
    const auto* q = maps.inverse_depth.ptr<float>(v);
    const auto* sigma = maps.sigma.ptr<float>(v);
    const float y = maps.rays.y[static_cast<std::size_t>(v)];
    for (int u = 0; u < labels.cols; u += kSampleStride) {
      if (label[u] == 0 || q[u] == 0) continue;
      of_sample(label[u], [&] {
        return PlaneSample{maps.rays.x[static_cast<std::size_t>(u)], y, q[u],
                           near.Of(q[u], sigma[u])};
      });
    }
  }
}

template <typename OfSamples>
auto SamplesByLabel::SumOver(std::size_t label, const OfSamples& of_samples) const {
  constexpr std::size_t kPart = 4096;
  const std::span<const PlaneSample> all = Of(label);
  if (all.size() <= kPart) return of_samples(all);
  std::vector<decltype(of_samples(all))> sums((all.size() + kPart - 1) / kPart);
  tbb::parallel_for(std::size_t{0}, sums.size(), [&](std::size_t i) {
    sums[i] = of_samples(all.subspan(i * kPart, std::min(kPart, all.size() - i * kPart)));
  });
  for (std::size_t i = 1; i < sums.size(); ++i) sums[0] += sums[i];
  return sums[0];
}

}  // namespace tsdfpp
