#include "core/polygon.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numeric>

namespace tsdfpp {
namespace {

// Cutting a face that is not convex takes time with its cube.
constexpr std::size_t kMostConcaveCorners = 400;
// Of all such faces together, the sum of the cubes of their corners: some seconds.
constexpr std::size_t kMostConcaveWork =
    20 * kMostConcaveCorners * kMostConcaveCorners * kMostConcaveCorners;

double Cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  return a.x() * b.y() - a.y() * b.x();
}

// Twice the area, positive when counter-clockwise.
double TwiceArea(const std::vector<Eigen::Vector2d>& polygon) {
  double sum = 0;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    sum += Cross(polygon[i], polygon[(i + 1) % polygon.size()]);
  }
  return sum;
}

}  // namespace

std::vector<std::array<std::uint32_t, 3>> CutPolygon(const std::vector<Eigen::Vector2d>& polygon) {
  const double sign = TwiceArea(polygon) < 0 ? -1 : 1;
  std::vector<std::uint32_t> left(polygon.size());
  std::iota(left.begin(), left.end(), 0U);
  std::vector<std::array<std::uint32_t, 3>> triangles;
  const auto is_ear = [&](std::size_t i) {
    const std::size_t n = left.size();
    const std::uint32_t ia = left[(i + n - 1) % n];
    const std::uint32_t ib = left[i];
    const std::uint32_t ic = left[(i + 1) % n];
    const Eigen::Vector2d& a = polygon[ia];
    const Eigen::Vector2d& b = polygon[ib];
    const Eigen::Vector2d& c = polygon[ic];
    if (!(sign * Cross(b - a, c - a) > 0)) return false;
    return std::none_of(left.begin(), left.end(), [&](std::uint32_t k) {
      if (k == ia || k == ib || k == ic) return false;
      const Eigen::Vector2d& p = polygon[k];
      if (p == a || p == b || p == c) return false;  // a vertex there twice
      return sign * Cross(b - a, p - a) >= 0 && sign * Cross(c - b, p - b) >= 0 &&
             sign * Cross(a - c, p - c) >= 0;
    });
  };
  while (left.size() > 3) {
    const std::size_t n = left.size();
    // Of all ears the one that is widest open, which avoids slivers.
    std::size_t best = n;
    double best_cosine = 2;
    for (std::size_t i = 0; i < n; ++i) {
      if (!is_ear(i)) continue;
      const Eigen::Vector2d before = polygon[left[(i + n - 1) % n]] - polygon[left[i]];
      const Eigen::Vector2d after = polygon[left[(i + 1) % n]] - polygon[left[i]];
      const double cosine = std::abs(before.normalized().dot(after.normalized()));
      if (cosine < best_cosine) {
        best = i;
        best_cosine = cosine;
      }
    }
    if (best == n) break;
    triangles.push_back({left[(best + n - 1) % n], left[best], left[(best + 1) % n]});
    left.erase(left.begin() + static_cast<std::ptrdiff_t>(best));
  }
  for (std::size_t i = 2; i < left.size(); ++i) {
    triangles.push_back({left[0], left[i - 1], left[i]});
  }
  return triangles;
}

Expected<std::vector<std::array<std::uint32_t, 3>>> FaceCutter::Cut(
    const std::vector<Eigen::Vector3d>& corners) {
  const std::size_t n = corners.size();
  const auto at = [&](std::size_t i) -> const Eigen::Vector3d& { return corners[i % n]; };
  // Newell's normal, of twice the area's length.
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < n; ++i) normal += (at(i) - at(0)).cross(at(i + 1) - at(0));
  bool convex = true;
  for (std::size_t i = 0; i < n; ++i) {
    const Eigen::Vector3d turn = (at(i + 1) - at(i)).cross(at(i + 2) - at(i + 1));
    convex = convex && turn.dot(normal) >= 0;
  }
  if (convex || n == 3) {
    std::vector<std::array<std::uint32_t, 3>> fan;
    for (std::uint32_t i = 2; i < n; ++i) fan.push_back({0, i - 1, i});
    return fan;
  }
  if (n > kMostConcaveCorners) {
    return DataError("a face that is not convex has {} corners, expected {} at most", n,
                     kMostConcaveCorners);
  }
  concave_work_ += n * n * n;
  if (concave_work_ > kMostConcaveWork) {
    return DataError("its faces that are not convex take too long to cut, expected triangles");
  }
  const Eigen::Vector3d u = normal.unitOrthogonal();
  const Eigen::Vector3d v = normal.normalized().cross(u);
  std::vector<Eigen::Vector2d> flat;
  for (std::size_t i = 0; i < n; ++i) flat.emplace_back(u.dot(at(i)), v.dot(at(i)));
  return CutPolygon(flat);
}

}  // namespace tsdfpp
