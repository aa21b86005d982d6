#include "mapper/segment/background.h"

#include <tbb/parallel_for.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>

namespace tsdfpp {
namespace {

// Planes are fitted to every second row's every second pixel.
constexpr int kStride = 2;
// Fewer samples do not make a plane.
constexpr double kLeastSamples = 8;
constexpr double kLargeShare = 0.5;
constexpr double kWithinShare = 0.9;
constexpr double kOff = 2;  // times NearPlane_m
// A wall, where little of it is seen: the room ends there, so next to nothing lies behind it.
constexpr double kWall_m2 = 0.005;
constexpr double kWallShare = 0.8;
constexpr double kBehindShare = 0.05;
constexpr int kThinning = 16;  // of the samples that are asked whether they are behind

struct Sample {
  double x = 0;  // the ray is (x, y, 1)
  double y = 0;
  double q = 0;       // inverse depth
  double near_m = 0;  // NearPlane_m
};

template <typename OfSample>
void ForEachSample(const SurfaceMaps& maps, const cv::Mat& labels,
                   const DepthSegmentsConfig& config, const OfSample& of_sample) {
  for (int v = 0; v < labels.rows; v += kStride) {
    const auto* label = labels.ptr<std::int32_t>(v);
    const auto* q = maps.inverse_depth.ptr<float>(v);
    const auto* sigma = maps.sigma.ptr<float>(v);
    const double y = maps.rays.y[static_cast<std::size_t>(v)];
    for (int u = 0; u < labels.cols; u += kStride) {
      if (label[u] == 0 || q[u] == 0) continue;
      of_sample(label[u], [&] {
        return Sample{maps.rays.x[static_cast<std::size_t>(u)], y, q[u],
                      NearPlane_m(sigma[u], 1 / double{q[u]}, maps.rays, config)};
      });
    }
  }
}

// Samples by label, each label's by rows: what is summed over them does not depend on threads.
class SamplesByLabel {
 public:
  SamplesByLabel(const SurfaceMaps& maps, const cv::Mat& labels, std::int32_t end,
                 const DepthSegmentsConfig& config)
      : begin_(static_cast<std::size_t>(end) + 1) {
    ForEachSample(maps, labels, config, [&](std::int32_t label, const auto&) {
      ++begin_[static_cast<std::size_t>(label) + 1];
    });
    for (std::size_t i = 1; i < begin_.size(); ++i) begin_[i] += begin_[i - 1];
    samples_.resize(begin_.back());
    std::vector<std::size_t> next(begin_.begin(), begin_.end() - 1);
    ForEachSample(maps, labels, config, [&](std::int32_t label, const auto& sample) {
      samples_[next[static_cast<std::size_t>(label)]++] = sample();
    });
  }

  std::size_t labels() const { return begin_.size() - 1; }
  std::span<const Sample> Of(std::size_t label) const {
    return std::span(samples_).subspan(begin_[label], begin_[label + 1] - begin_[label]);
  }

  // In parallel.
  template <typename OfLabel>
  void ForEachLabel(const OfLabel& of_label) const {
    tbb::parallel_for(std::size_t{0}, labels(), of_label);
  }

 private:
  std::vector<std::size_t> begin_;  // by label, and the end of the last
  std::vector<Sample> samples_;
};

// Normal equations of q = a x + b y + c, and the solution.
struct InversePlane {
  double n = 0, x = 0, y = 0, q = 0, xx = 0, xy = 0, yy = 0, xq = 0, yq = 0;
  double a = 0, b = 0, c = 0;
  bool is_solved = false;

  void Add(const Sample& s) {
    n += 1;
    x += s.x;
    y += s.y;
    q += s.q;
    xx += s.x * s.x;
    xy += s.x * s.y;
    yy += s.y * s.y;
    xq += s.x * s.q;
    yq += s.y * s.q;
  }
  void Solve() {
    is_solved = false;
    if (n < kLeastSamples) return;
    Eigen::Matrix3d equations;
    equations << xx, xy, x, xy, yy, y, x, y, n;
    const Eigen::Vector3d abc = equations.ldlt().solve(Eigen::Vector3d(xq, yq, q));
    if (!abc.allFinite() || !(abc.norm() > 0)) return;
    a = abc.x();
    b = abc.y();
    c = abc.z();
    is_solved = true;
  }
  // Metres along the ray from the plane to the sample, positive behind it.
  double Off_m(const Sample& s) const { return (a * s.x + b * s.y + c - s.q) / (s.q * s.q); }
};

std::vector<InversePlane> FitInverse(const SamplesByLabel& samples) {
  std::vector<InversePlane> planes(samples.labels());
  samples.ForEachLabel([&](std::size_t label) {
    InversePlane& plane = planes[label];
    for (const double within : {std::numeric_limits<double>::infinity(), 8.0, 4.0, 2.0, 1.0, 1.0}) {
      InversePlane next;
      for (const Sample& s : samples.Of(label)) {
        if (std::isfinite(within)) {
          if (!plane.is_solved || std::abs(plane.Off_m(s)) > within * s.near_m) continue;
        }
        next.Add(s);
      }
      next.Solve();
      plane = next;
    }
  });
  return planes;
}

SegmentPlane AsPlane(const InversePlane& fitted) {
  SegmentPlane plane;
  if (!fitted.is_solved) return plane;
  const Eigen::Vector3d abc(fitted.a, fitted.b, fitted.c);
  plane.is_plane = true;
  plane.normal = -abc.normalized();
  plane.distance_m = -1 / abc.norm();
  return plane;
}

// Areas, and shares of the segments, near their planes.
std::vector<SegmentPlane> Measure(const SurfaceMaps& maps, const SamplesByLabel& samples,
                                  const std::vector<InversePlane>& fitted) {
  // A plane that is seen from its side covers a pixel with much; no more than at this cosine.
  constexpr double kLeastCosine = 0.05;
  const double pixel_area = kStride * kStride / double{maps.rays.per_x} / double{maps.rays.per_y};
  std::vector<SegmentPlane> planes(fitted.size());
  samples.ForEachLabel([&](std::size_t label) {
    SegmentPlane& plane = planes[label];
    plane = AsPlane(fitted[label]);
    double on = 0;
    for (const Sample& s : samples.Of(label)) {
      if (!plane.is_plane || std::abs(fitted[label].Off_m(s)) > s.near_m) continue;
      on += 1;
      const double facing = -(plane.normal.x() * s.x + plane.normal.y() * s.y + plane.normal.z());
      plane.area_m2 += pixel_area / (s.q * s.q) / std::max(facing, kLeastCosine);
    }
    const auto all = static_cast<double>(samples.Of(label).size());
    if (all > 0) plane.on_share = on / all;
  });
  return planes;
}

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
  ForEachSample(maps, labels, config, [&](std::int32_t, const auto& sample) {
    if (count++ % kThinning != 0) return;
    all += 1;
    const Sample s = sample();
    for (std::size_t i = 0; i < candidates.size(); ++i) {
      if (fitted[candidates[i]].Off_m(s) > kOff * s.near_m) behind[i] += 1;
    }
  });
  std::vector<std::size_t> walls;
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    if (behind[i] <= kBehindShare * all) walls.push_back(candidates[i]);
  }
  return walls;
}

// Whether nine tenths of each label's samples are near one of the large planes. A byte a label, as
// threads write them side by side.
std::vector<std::uint8_t> FindWithin(const SamplesByLabel& samples,
                                     const std::vector<InversePlane>& fitted,
                                     const std::vector<std::size_t>& large) {
  std::vector<std::uint8_t> is_within(fitted.size());
  samples.ForEachLabel([&](std::size_t label) {
    const std::span<const Sample> of_label = samples.Of(label);
    if (label == 0 || of_label.empty()) return;
    for (const std::size_t plane : large) {
      const auto near = std::count_if(of_label.begin(), of_label.end(), [&](const Sample& s) {
        return std::abs(fitted[plane].Off_m(s)) <= s.near_m;
      });
      const auto all = static_cast<double>(of_label.size());
      if (static_cast<double>(near) >= kWithinShare * all) is_within[label] = 1;
    }
  });
  return is_within;
}

}  // namespace

std::vector<SegmentPlane> FitPlanes(const SurfaceMaps& maps, const cv::Mat& labels,
                                    std::int32_t end, const DepthSegmentsConfig& config) {
  const SamplesByLabel samples(maps, labels, end, config);
  return Measure(maps, samples, FitInverse(samples));
}

std::int32_t PartBackground(const SurfaceMaps& maps, const PixelLinks& links, const PartSize& least,
                            std::int32_t end, const DepthSegmentsConfig& config, cv::Mat& labels) {
  const SamplesByLabel samples(maps, labels, end, config);
  const std::vector<InversePlane> fitted = FitInverse(samples);
  const std::vector<SegmentPlane> planes = Measure(maps, samples, fitted);
  std::vector<std::size_t> large;
  std::vector<bool> is_large(planes.size());
  for (std::size_t label = 1; label < planes.size(); ++label) {
    const SegmentPlane& plane = planes[label];
    is_large[label] =
        plane.is_plane && plane.area_m2 >= config.plane_m2 && plane.on_share >= kLargeShare;
  }
  for (const std::size_t label : FindWalls(maps, labels, fitted, planes, config)) {
    is_large[label] = true;
  }
  for (std::size_t label = 1; label < planes.size(); ++label) {
    if (is_large[label]) large.push_back(label);
  }
  if (large.empty()) return end;
  const std::vector<std::uint8_t> is_within = FindWithin(samples, fitted, large);
  cv::Mat off(labels.size(), CV_8UC1);
  ForEachRow(labels.rows, [&](int v) {
    auto* row = labels.ptr<std::int32_t>(v);
    auto* is_off = off.ptr<std::uint8_t>(v);
    const auto* q = maps.inverse_depth.ptr<float>(v);
    const auto* sigma = maps.sigma.ptr<float>(v);
    const double y = maps.rays.y[static_cast<std::size_t>(v)];
    for (int u = 0; u < labels.cols; ++u) {
      is_off[u] = 0;
      const auto label = static_cast<std::size_t>(row[u]);
      if (label == 0 || !(is_large[label] || is_within[label] != 0)) continue;
      row[u] = kBackgroundLabel;
      if (!is_large[label]) continue;
      const Sample s{maps.rays.x[static_cast<std::size_t>(u)], y, q[u],
                     NearPlane_m(sigma[u], 1 / double{q[u]}, maps.rays, config)};
      if (std::abs(fitted[label].Off_m(s)) > kOff * s.near_m) is_off[u] = 255;
    }
  });
  cv::Mat parts = cv::Mat::zeros(labels.size(), CV_32SC1);
  const std::int32_t parts_end = LabelComponents(off, links, 1, parts);
  const std::vector<PartSize> sizes =
      MeasureParts(parts, maps.depth, maps.rays.pixel_width, parts_end);
  std::vector<std::int32_t> label_of(sizes.size());
  for (std::size_t part = 1; part < sizes.size(); ++part) {
    const bool is_small = sizes[part].pixels < least.pixels || sizes[part].area_m2 < least.area_m2;
    label_of[part] = is_small ? kBackgroundLabel : end++;
  }
  ForEachRow(labels.rows, [&](int v) {
    auto* row = labels.ptr<std::int32_t>(v);
    const auto* part = parts.ptr<std::int32_t>(v);
    for (int u = 0; u < labels.cols; ++u) {
      if (part[u] != 0) row[u] = label_of[static_cast<std::size_t>(part[u])];
    }
  });
  return end;
}

}  // namespace tsdfpp
