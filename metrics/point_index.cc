#include "metrics/point_index.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace tsdfpp {
namespace {

// A range of so few points is walked through.
constexpr std::size_t kLeaf = 8;

}  // namespace

PointIndex::PointIndex(std::span<const Eigen::Vector3f> points)
    : points_(points.begin(), points.end()), original_(points.size()), axis_(points.size(), 0) {
  std::iota(original_.begin(), original_.end(), 0U);
  Build(0, points_.size());
  for (std::size_t i = 0; i < points_.size(); ++i) points_[i] = points[original_[i]];
}

// Orders `original_` while `points_` still has the order given.
void PointIndex::Build(std::size_t begin, std::size_t end) {
  if (end - begin <= kLeaf) return;
  Eigen::AlignedBox3f box;
  for (std::size_t i = begin; i < end; ++i) box.extend(points_[original_[i]]);
  Eigen::Index axis = 0;
  box.sizes().maxCoeff(&axis);
  const std::size_t middle = begin + (end - begin) / 2;
  const auto at = [&](std::size_t i) { return original_.begin() + static_cast<std::ptrdiff_t>(i); };
  std::nth_element(at(begin), at(middle), at(end), [&](std::uint32_t a, std::uint32_t b) {
    return points_[a][axis] < points_[b][axis];
  });
  axis_[middle] = static_cast<std::uint8_t>(axis);
  Build(begin, middle);
  Build(middle + 1, end);
}

void PointIndex::Search(std::size_t begin, std::size_t end, const Eigen::Vector3d& query,
                        std::uint32_t except, double& least2) const {
  const auto look = [&](std::size_t i) {
    if (original_[i] == except) return;
    least2 = std::min(least2, (points_[i].cast<double>() - query).squaredNorm());
  };
  if (end - begin <= kLeaf) {
    for (std::size_t i = begin; i < end; ++i) look(i);
    return;
  }
  const std::size_t middle = begin + (end - begin) / 2;
  look(middle);
  const Eigen::Index axis = axis_[middle];
  const double beyond = query[axis] - static_cast<double>(points_[middle][axis]);
  const bool upper_first = beyond > 0;
  Search(upper_first ? middle + 1 : begin, upper_first ? end : middle, query, except, least2);
  // Also where both are 0: among many equal points one is enough.
  if (beyond * beyond >= least2) return;
  Search(upper_first ? begin : middle + 1, upper_first ? middle : end, query, except, least2);
}

double PointIndex::Nearest2(const Eigen::Vector3d& query, std::uint32_t except) const {
  double least2 = std::numeric_limits<double>::infinity();
  Search(0, points_.size(), query, except, least2);
  return least2;
}

std::vector<double> PointIndex::Distances_m(std::span<const Eigen::Vector3f> queries) const {
  std::vector<double> distances(queries.size());
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, queries.size(), 256), [&](const auto& range) {
        for (std::size_t i = range.begin(); i < range.end(); ++i) {
          distances[i] = std::sqrt(Nearest2(queries[i].template cast<double>(), kNobody));
        }
      });
  return distances;
}

std::vector<double> PointIndex::Spacings_m() const {
  std::vector<double> spacings(points_.size());
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, points_.size(), 256),
                    [&](const auto& range) {
                      for (std::size_t i = range.begin(); i < range.end(); ++i) {
                        spacings[original_[i]] =
                            std::sqrt(Nearest2(points_[i].template cast<double>(), original_[i]));
                      }
                    });
  return spacings;
}

}  // namespace tsdfpp
