#include "mapper/segment/background.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

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
  std::int32_t label = 0;
  double x = 0;  // the ray is (x, y, 1)
  double y = 0;
  double q = 0;  // inverse depth
  double sigma_m = 0;
};

template <typename OfSample>
void ForEachSample(const SurfaceMaps& maps, const cv::Mat& labels, const OfSample& of_sample) {
  for (int v = 0; v < labels.rows; v += kStride) {
    const auto* label = labels.ptr<std::int32_t>(v);
    const auto* q = maps.inverse_depth.ptr<float>(v);
    const auto* sigma = maps.sigma.ptr<float>(v);
    const double y = maps.rays.y[static_cast<std::size_t>(v)];
    for (int u = 0; u < labels.cols; u += kStride) {
      if (label[u] == 0 || q[u] == 0) continue;
      of_sample(Sample{label[u], maps.rays.x[static_cast<std::size_t>(u)], y, q[u], sigma[u]});
    }
  }
}

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

std::vector<InversePlane> FitInverse(const SurfaceMaps& maps, const cv::Mat& labels,
                                     std::int32_t end, const DepthSegmentsConfig& config) {
  std::vector<InversePlane> planes(static_cast<std::size_t>(end));
  for (const double within : {std::numeric_limits<double>::infinity(), 8.0, 4.0, 2.0, 1.0, 1.0}) {
    std::vector<InversePlane> next(planes.size());
    ForEachSample(maps, labels, [&](const Sample& s) {
      const auto label = static_cast<std::size_t>(s.label);
      if (std::isfinite(within)) {
        const InversePlane& plane = planes[label];
        const double near_m = NearPlane_m(s.sigma_m, 1 / s.q, maps.rays, config);
        if (!plane.is_solved || std::abs(plane.Off_m(s)) > within * near_m) return;
      }
      next[label].Add(s);
    });
    for (InversePlane& plane : next) plane.Solve();
    planes = std::move(next);
  }
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
std::vector<SegmentPlane> Measure(const SurfaceMaps& maps, const cv::Mat& labels,
                                  const std::vector<InversePlane>& fitted,
                                  const DepthSegmentsConfig& config) {
  // A plane that is seen from its side covers a pixel with much; no more than at this cosine.
  constexpr double kLeastCosine = 0.05;
  std::vector<SegmentPlane> planes;
  planes.reserve(fitted.size());
  for (const InversePlane& plane : fitted) planes.push_back(AsPlane(plane));
  std::vector<double> all(fitted.size());
  std::vector<double> on(fitted.size());
  const double pixel_area = kStride * kStride / double{maps.rays.per_x} / double{maps.rays.per_y};
  ForEachSample(maps, labels, [&](const Sample& s) {
    const auto label = static_cast<std::size_t>(s.label);
    SegmentPlane& plane = planes[label];
    all[label] += 1;
    const double near_m = NearPlane_m(s.sigma_m, 1 / s.q, maps.rays, config);
    if (!plane.is_plane || std::abs(fitted[label].Off_m(s)) > near_m) return;
    on[label] += 1;
    const double facing = -(plane.normal.x() * s.x + plane.normal.y() * s.y + plane.normal.z());
    plane.area_m2 += pixel_area / (s.q * s.q) / std::max(facing, kLeastCosine);
  });
  for (std::size_t i = 0; i < planes.size(); ++i) {
    if (all[i] > 0) planes[i].on_share = on[i] / all[i];
  }
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
  ForEachSample(maps, labels, [&](const Sample& s) {
    if (count++ % kThinning != 0) return;
    all += 1;
    const double near_m = NearPlane_m(s.sigma_m, 1 / s.q, maps.rays, config);
    for (std::size_t i = 0; i < candidates.size(); ++i) {
      if (fitted[candidates[i]].Off_m(s) > kOff * near_m) behind[i] += 1;
    }
  });
  std::vector<std::size_t> walls;
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    if (behind[i] <= kBehindShare * all) walls.push_back(candidates[i]);
  }
  return walls;
}

// Whether nine tenths of each label's samples are near one of the large planes.
std::vector<bool> FindWithin(const SurfaceMaps& maps, const cv::Mat& labels,
                             const std::vector<InversePlane>& fitted,
                             const std::vector<std::size_t>& large,
                             const DepthSegmentsConfig& config) {
  std::vector<double> all(fitted.size());
  std::vector<std::vector<double>> near(fitted.size(), std::vector<double>(large.size()));
  ForEachSample(maps, labels, [&](const Sample& s) {
    const auto label = static_cast<std::size_t>(s.label);
    all[label] += 1;
    const double near_m = NearPlane_m(s.sigma_m, 1 / s.q, maps.rays, config);
    for (std::size_t i = 0; i < large.size(); ++i) {
      if (std::abs(fitted[large[i]].Off_m(s)) <= near_m) near[label][i] += 1;
    }
  });
  std::vector<bool> is_within(fitted.size());
  for (std::size_t label = 1; label < fitted.size(); ++label) {
    for (const double samples : near[label]) {
      if (all[label] > 0 && samples >= kWithinShare * all[label]) is_within[label] = true;
    }
  }
  return is_within;
}

}  // namespace

std::vector<SegmentPlane> FitPlanes(const SurfaceMaps& maps, const cv::Mat& labels,
                                    std::int32_t end, const DepthSegmentsConfig& config) {
  return Measure(maps, labels, FitInverse(maps, labels, end, config), config);
}

std::int32_t PartBackground(const SurfaceMaps& maps, const PixelLinks& links, const PartSize& least,
                            std::int32_t end, const DepthSegmentsConfig& config, cv::Mat& labels) {
  const std::vector<InversePlane> fitted = FitInverse(maps, labels, end, config);
  const std::vector<SegmentPlane> planes = Measure(maps, labels, fitted, config);
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
  const std::vector<bool> is_within = FindWithin(maps, labels, fitted, large, config);
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
      if (label == 0 || !(is_large[label] || is_within[label])) continue;
      row[u] = kBackgroundLabel;
      if (!is_large[label]) continue;
      const Sample s{row[u], maps.rays.x[static_cast<std::size_t>(u)], y, q[u], sigma[u]};
      const double near_m = NearPlane_m(s.sigma_m, 1 / s.q, maps.rays, config);
      if (std::abs(fitted[label].Off_m(s)) > kOff * near_m) is_off[u] = 255;
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
