#include "metrics/normal_agreement.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <atomic>
#include <bit>
#include <cmath>

#include "metrics/mesh_tools.h"

namespace tsdfpp {
namespace {

// The points that need a second look, in cells of a dense grid (a counting sort). Points rather
// than triangles are put in cells since they are few, whereas a triangle may be of any size.
class PointGrid {
 public:
  PointGrid(std::span<const Eigen::Vector3f> points, std::vector<std::uint32_t> chosen,
            float cell_m) {
    Eigen::AlignedBox3f box;
    for (const std::uint32_t i : chosen) box.extend(points[i]);
    // At most some 2 million cells, however far apart the points lie.
    constexpr double kMaxCells = 2e6;
    const Eigen::Vector3d extent = box.sizes().cast<double>();
    constexpr double kSmallestCell_m = 1e-6;
    double cell = std::max(static_cast<double>(cell_m), kSmallestCell_m);
    while (CellCount(extent, cell) > kMaxCells) cell *= 1.3;
    origin_ = box.min();
    inverse_cell_ = static_cast<float>(1.0 / cell);
    for (int k = 0; k < 3; ++k) size_[k] = static_cast<int>(extent[k] / cell) + 1;

    first_.assign(static_cast<std::size_t>(size_.prod()) + 1, 0);
    for (const std::uint32_t i : chosen) ++first_[Index(CellOf(points[i])) + 1];
    for (std::size_t c = 1; c < first_.size(); ++c) first_[c] += first_[c - 1];
    std::vector<std::uint32_t> next(first_.begin(), first_.end() - 1);
    members_.resize(chosen.size());
    for (const std::uint32_t i : chosen) members_[next[Index(CellOf(points[i]))]++] = i;
  }

  // Calls visit(i) for every point whose cell meets the box.
  template <typename Visit>
  void ForEachNear(const Eigen::AlignedBox3f& box, const Visit& visit) const {
    const Eigen::Vector3f low = (box.min() - origin_) * inverse_cell_;
    const Eigen::Vector3f high = (box.max() - origin_) * inverse_cell_;
    Eigen::Vector3i from;
    Eigen::Vector3i to;
    for (int k = 0; k < 3; ++k) {
      const float end = static_cast<float>(size_[k]);
      if (high[k] < 0.0F || low[k] >= end) return;
      from[k] = low[k] <= 0.0F ? 0 : static_cast<int>(low[k]);
      to[k] = high[k] >= end ? size_[k] - 1 : static_cast<int>(high[k]);
    }
    for (int z = from.z(); z <= to.z(); ++z) {
      for (int y = from.y(); y <= to.y(); ++y) {
        // Cells in a row along x are neighbours in memory.
        const std::uint32_t begin = first_[Index({from.x(), y, z})];
        const std::uint32_t end = first_[Index({to.x(), y, z}) + 1];
        for (std::uint32_t m = begin; m < end; ++m) visit(members_[m]);
      }
    }
  }

 private:
  static double CellCount(const Eigen::Vector3d& extent, double cell) {
    return (extent.x() / cell + 1) * (extent.y() / cell + 1) * (extent.z() / cell + 1);
  }
  Eigen::Vector3i CellOf(const Eigen::Vector3f& point) const {
    const Eigen::Vector3f scaled = (point - origin_) * inverse_cell_;
    return {std::clamp(static_cast<int>(scaled.x()), 0, size_.x() - 1),
            std::clamp(static_cast<int>(scaled.y()), 0, size_.y() - 1),
            std::clamp(static_cast<int>(scaled.z()), 0, size_.z() - 1)};
  }
  std::size_t Index(const Eigen::Vector3i& cell) const {
    return (static_cast<std::size_t>(cell.z()) * static_cast<std::size_t>(size_.y()) +
            static_cast<std::size_t>(cell.y())) *
               static_cast<std::size_t>(size_.x()) +
           static_cast<std::size_t>(cell.x());
  }

  Eigen::Vector3f origin_;
  float inverse_cell_ = 1;
  Eigen::Vector3i size_ = Eigen::Vector3i::Ones();
  std::vector<std::uint32_t> first_;
  std::vector<std::uint32_t> members_;
};

// Keeps the smallest. Non-negative floats order as their bits do, and a minimum is the same in any
// order, so threads do not change the result.
void LowerTo(float distance, std::uint32_t& smallest_bits) {
  std::atomic_ref<std::uint32_t> smallest(smallest_bits);
  const auto bits = std::bit_cast<std::uint32_t>(distance);
  std::uint32_t seen = smallest.load(std::memory_order_relaxed);
  while (bits < seen && !smallest.compare_exchange_weak(seen, bits, std::memory_order_relaxed)) {
  }
}

}  // namespace

SampleMatch MatchSurface(std::span<const Eigen::Vector3f> points,
                         std::span<const Eigen::Vector3f> normals, const SurfaceIndex& surface,
                         double limit_m, double max_angle_rad) {
  NearestSurface nearest = surface.Nearest(points);
  const auto min_cosine = static_cast<float>(std::cos(max_angle_rad));
  const auto limit = static_cast<float>(limit_m);
  SampleMatch match;
  match.agreeing_m.assign(points.size(), std::numeric_limits<float>::infinity());
  std::vector<std::uint32_t> doubtful;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!(nearest.distance_m[i] <= limit)) continue;
    if (nearest.normal[i].dot(normals[i]) >= min_cosine) {
      match.agreeing_m[i] = nearest.distance_m[i];
    } else {
      doubtful.push_back(static_cast<std::uint32_t>(i));
    }
  }
  match.nearest_m = std::move(nearest.distance_m);
  if (doubtful.empty()) return match;

  std::vector<std::uint32_t> smallest_bits(
      points.size(), std::bit_cast<std::uint32_t>(std::numeric_limits<float>::infinity()));
  const PointGrid grid(points, doubtful, limit);
  const TriangleMesh& mesh = surface.mesh();
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, mesh.triangles.size(), 4096), [&](const auto& range) {
        for (std::size_t t = range.begin(); t < range.end(); ++t) {
          const Eigen::Vector3f& a = Corner(mesh, t, 0);
          const Eigen::Vector3f& b = Corner(mesh, t, 1);
          const Eigen::Vector3f& c = Corner(mesh, t, 2);
          Eigen::AlignedBox3f box(a);
          box.extend(b).extend(c);
          box.min().array() -= limit;
          box.max().array() += limit;
          grid.ForEachNear(box, [&](std::uint32_t i) {
            if (!box.contains(points[i]) || surface.normals()[t].dot(normals[i]) < min_cosine) {
              return;
            }
            const float distance = PointTriangleDistance(points[i], a, b, c);
            if (distance <= limit) LowerTo(distance, smallest_bits[i]);
          });
        }
      });
  for (const std::uint32_t i : doubtful) {
    match.agreeing_m[i] = std::bit_cast<float>(smallest_bits[i]);
  }
  return match;
}

}  // namespace tsdfpp
