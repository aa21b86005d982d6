#include "mapper/volume/facing.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <optional>
#include <utility>
#include <vector>

#include "core/robust_deviation.h"

namespace tsdfpp {
namespace {

// Rows and columns to each side over which a plane is fitted.
constexpr int kReach_px = 3;
// A surface at a steeper angle to the ray is a step.
constexpr double kSteepest = 11.4;  // the tangent of 85 degrees
// So many deviations of noise are none either.
constexpr double kNoiseDeviations = 4;
// Of a second difference of three numbers with equal noise, to that of one.
constexpr double kSecondDifference = 2.449489742783178;  // sqrt(1 + 4 + 1)
// Rows and columns of which the noise is found.
constexpr int kNoiseStride_px = 7;
constexpr int kFewestPixels = 9;
// Pixels lie on a plane where the root of their mean square off it is at most so many deviations of
// the noise, and a ten-thousandth of the inverse depth ...
constexpr double kFlatDeviations = 1.5;
constexpr double kFlat = 1e-4;
// ... or where the mean square is at most so many times that of a quarter of them, which a bend of
// twice the width makes sixteen times less: then it is noise, of which a grazing angle makes more.
constexpr double kBent = 4;
// Where a surface is seen from farther aside, little is known of its normal.
constexpr double kLeastCosine = 0.1;
// A pixel without a plane, as at an edge, takes the mean of those so many rows and columns around.
constexpr int kEdge_px = 2;
// Up to this angle, of 45 degrees, distances stay along the rays.
constexpr float kOblique = 0.70710678F;
constexpr int kFittedRowsPerTask = 8;

// Inverse depth, 0 where there is none.
cv::Mat InverseDepthOf(const cv::Mat& depth) {
  cv::Mat inverse(depth.size(), CV_32FC1);
  for (int v = 0; v < depth.rows; ++v) {
    const auto* z = depth.ptr<float>(v);
    auto* w = inverse.ptr<float>(v);
    for (int u = 0; u < depth.cols; ++u) w[u] = IsValidDepth(z[u]) ? 1 / z[u] : 0;
  }
  return inverse;
}

// The deviation of inverse depths, relative to them: by second differences along rows, of which
// most are on one surface.
double RelativeNoiseOf(const cv::Mat& inverse, const cv::Mat& labels) {
  std::vector<float> sizes;
  for (int v = 0; v < inverse.rows; v += kNoiseStride_px) {
    const auto* w = inverse.ptr<float>(v);
    const auto* id = labels.ptr<InstanceId>(v);
    for (int u = 1; u + 1 < inverse.cols; u += kNoiseStride_px) {
      if (w[u - 1] <= 0 || w[u] <= 0 || w[u + 1] <= 0) continue;
      if (id[u - 1] != id[u] || id[u + 1] != id[u]) continue;
      sizes.push_back(std::abs(w[u - 1] - 2 * w[u] + w[u + 1]) / w[u]);
    }
  }
  return RobustDeviation(std::move(sizes)) / kSecondDifference;
}

// Sums over pixels of h h^T, h = (1, columns, rows, inverse depth) from one pixel on.
using PixelSums = Eigen::Matrix4d;

// A plane through some pixels around one.
struct FittedPlane {
  double du = 0;           // of inverse depth, a column
  double dv = 0;           // and a row
  double mean_square = 0;  // of what is left
};

// By least squares; nothing where the pixels are too few, or in a line.
std::optional<FittedPlane> PlaneThrough(const PixelSums& s) {
  const double n = s(0, 0);
  if (n < kFewestPixels) return std::nullopt;
  const Eigen::Matrix3d about_mean =
      s.bottomRightCorner<3, 3>() - s.bottomLeftCorner<3, 1>() * s.topRightCorner<1, 3>() / n;
  const double xx = about_mean(0, 0);
  const double xy = about_mean(0, 1);
  const double yy = about_mean(1, 1);
  const double xz = about_mean(0, 2);
  const double yz = about_mean(1, 2);
  const double zz = about_mean(2, 2);
  const double det = xx * yy - xy * xy;
  if (!(det > 0)) return std::nullopt;
  FittedPlane plane;
  plane.du = (xz * yy - yz * xy) / det;
  plane.dv = (yz * xx - xz * xy) / det;
  plane.mean_square = std::max(0.0, zz - plane.du * xz - plane.dv * yz) / n;
  return plane;
}

// The images that the fits read.
struct PlaneFit {
  // Sums of the pixels above, beside and below a pixel (rows of three) and left, at and right of
  // it, with the same label and without a step between.
  using Parts = std::array<PixelSums, 9>;

  Parts Around(int v, int u) const {
    Parts parts;
    parts.fill(PixelSums::Zero());
    const float w = inverse.at<float>(v, u);
    const InstanceId id = labels.at<InstanceId>(v, u);
    for (int j = std::max(0, v - kReach_px); j <= std::min(inverse.rows - 1, v + kReach_px); ++j) {
      const auto* row = inverse.ptr<float>(j);
      const auto* ids = labels.ptr<InstanceId>(j);
      const int third = j < v ? 0 : j == v ? 3 : 6;
      const int first = std::max(0, u - kReach_px);
      const int last = std::min(inverse.cols - 1, u + kReach_px);
      for (int i = first; i <= last; ++i) {
        if (!(row[i] > 0) || ids[i] != id) continue;
        const double dz = row[i] - w;
        const int way = std::max(std::abs(i - u), std::abs(j - v));
        if (std::abs(dz) > double{w} * (step * way + kNoiseDeviations * noise)) continue;
        const Eigen::Vector4d h(1, i - u, j - v, dz);
        parts[static_cast<std::size_t>(third + (i < u ? 0 : i == u ? 1 : 2))] += h * h.transpose();
      }
    }
    return parts;
  }

  // Of the four quarters that the pixel is a corner of, the one that is most of a plane.
  static std::optional<FittedPlane> BestSide(const Parts& parts) {
    std::optional<FittedPlane> best;
    for (const std::size_t corner : {0U, 1U, 3U, 4U}) {
      PixelSums quarter = parts[corner];
      for (const std::size_t next : {1U, 3U, 4U}) quarter += parts[corner + next];
      const std::optional<FittedPlane> plane = PlaneThrough(quarter);
      if (plane && (!best || plane->mean_square < best->mean_square)) best = plane;
    }
    return best;
  }

  // Inverse depth w = n^T r / d on a plane n^T p = d.
  double Cosine(int v, int u, const FittedPlane& plane) const {
    const double w = inverse.at<float>(v, u);
    const double x = (u - camera.cx) / camera.fx;
    const double y = (v - camera.cy) / camera.fy;
    const double nx = camera.fx * plane.du;
    const double ny = camera.fy * plane.dv;
    const double nz = w - nx * x - ny * y;
    return w / std::sqrt((nx * nx + ny * ny + nz * nz) * (x * x + y * y + 1));
  }

  // Depth of an object, not of the background.
  bool IsOfObject(int v, int u) const {
    const InstanceId id = labels.at<InstanceId>(v, u);
    return inverse.at<float>(v, u) > 0 && id != kBackground && id != kNoInstance;
  }

  // The cosine at an object's pixel; nothing where it shows no plane.
  std::optional<float> At(int v, int u) const {
    const double w = inverse.at<float>(v, u);
    const double flat = w * (kFlatDeviations * noise + kFlat);
    const Parts parts = Around(v, u);
    PixelSums all = PixelSums::Zero();
    for (const PixelSums& part : parts) all += part;
    std::optional<FittedPlane> plane = PlaneThrough(all);
    if (plane && plane->mean_square > flat * flat) {
      const std::optional<FittedPlane> side = BestSide(parts);
      if (!side || plane->mean_square > kBent * side->mean_square) {
        plane = side && side->mean_square <= flat * flat ? side : std::nullopt;
      }
    }
    if (!plane) return std::nullopt;
    return static_cast<float>(std::clamp(Cosine(v, u, *plane), kLeastCosine, 1.0));
  }

  cv::Mat inverse;  // depths
  cv::Mat labels;
  Intrinsics camera;
  double step = 0;   // of inverse depth, relative, for each row or column
  double noise = 0;  // a pixel's deviation, relative
};

// The pixel's, or where it has none the mean of those beside it with the same label; 1 where these
// have none either.
float CosineBeside(const cv::Mat& cosines, const cv::Mat& labels, int v, int u) {
  if (const float own = cosines.at<float>(v, u); own > 0) return own;
  const InstanceId id = labels.at<InstanceId>(v, u);
  float sum = 0;
  int count = 0;
  for (int j = std::max(0, v - kEdge_px); j <= std::min(cosines.rows - 1, v + kEdge_px); ++j) {
    for (int i = std::max(0, u - kEdge_px); i <= std::min(cosines.cols - 1, u + kEdge_px); ++i) {
      if (!(cosines.at<float>(j, i) > 0) || labels.at<InstanceId>(j, i) != id) continue;
      sum += cosines.at<float>(j, i);
      ++count;
    }
  }
  return count > 0 ? sum / static_cast<float>(count) : 1;
}

void ForRows(int rows, const std::function<void(int)>& run) {
  tbb::parallel_for(
      tbb::blocked_range<int>(0, rows, kFittedRowsPerTask),
      [&](const tbb::blocked_range<int>& range) {
        for (int v = range.begin(); v != range.end(); ++v) run(v);
      },
      tbb::simple_partitioner());
}

}  // namespace

cv::Mat FacingOf(const Frame& frame, const cv::Mat& labels) {
  PlaneFit fit{InverseDepthOf(frame.depth), labels, frame.intrinsics};
  fit.noise = RelativeNoiseOf(fit.inverse, labels);
  fit.step = kSteepest / std::max(frame.intrinsics.fx, frame.intrinsics.fy);
  cv::Mat cosines(frame.depth.size(), CV_32FC1);  // 0 where there is no plane
  ForRows(cosines.rows, [&](int v) {
    auto* row = cosines.ptr<float>(v);
    for (int u = 0; u < cosines.cols; ++u)
      row[u] = fit.IsOfObject(v, u) ? fit.At(v, u).value_or(0) : 0;
  });
  cv::Mat facing(cosines.size(), CV_32FC1);
  ForRows(facing.rows, [&](int v) {
    auto* row = facing.ptr<float>(v);
    for (int u = 0; u < facing.cols; ++u) {
      row[u] =
          fit.IsOfObject(v, u) ? std::min(1.0F, CosineBeside(cosines, labels, v, u) / kOblique) : 1;
    }
  });
  return facing;
}

}  // namespace tsdfpp
