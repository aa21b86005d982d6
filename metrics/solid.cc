#include "metrics/solid.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

#include "metrics/mesh_tools.h"

namespace tsdfpp {
namespace {

// Which side of the line a-b the point is on, seen along z: 1 left, -1 right. Never 0: a point on
// the line counts as moved by (e, e^2), e -> 0. Swapping a and b negates the answer exactly, so a
// ray through an edge crosses exactly one of the two triangles that share it.
int SideOf(const Eigen::Vector3f& a, const Eigen::Vector3f& b, const Eigen::Vector3f& point) {
  const bool swapped = b.x() < a.x() || (b.x() == a.x() && b.y() < a.y());
  const Eigen::Vector3f& from = swapped ? b : a;
  const Eigen::Vector3f& to = swapped ? a : b;
  const double dx = static_cast<double>(to.x()) - from.x();
  const double dy = static_cast<double>(to.y()) - from.y();
  double side = dx * (static_cast<double>(point.y()) - from.y()) -
                dy * (static_cast<double>(point.x()) - from.x());
  if (side == 0) side = dy != 0 ? -dy : dx;
  if (side == 0) return 1;
  return (side > 0) != swapped ? 1 : -1;
}

}  // namespace

Solid::Solid(const TriangleMesh& mesh) : mesh_(mesh), bounds_(BoundsOf(mesh)) {
  if (mesh.triangles.empty()) return;
  constexpr int kMaxColumns = 256;
  // Of triangles as wide as the mesh every column would hold every one: then there are fewer.
  constexpr std::size_t kMostEntries = 16;  // a triangle
  int columns = std::clamp(static_cast<int>(std::sqrt(static_cast<double>(mesh.triangles.size()))),
                           1, kMaxColumns);
  while (true) {
    SetColumns(columns);
    std::size_t entries = 0;
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) entries += ColumnsOf(t).Count();
    if (columns == 1 || entries <= kMostEntries * mesh.triangles.size()) break;
    columns /= 2;
  }
  first_.assign(static_cast<std::size_t>(columns_x_ * columns_y_) + 1, 0);
  ForEachEntry([&](std::size_t column, std::uint32_t) { ++first_[column + 1]; });
  for (std::size_t c = 1; c < first_.size(); ++c) first_[c] += first_[c - 1];
  members_.resize(first_.back());
  std::vector<std::size_t> next(first_.begin(), first_.end() - 1);
  ForEachEntry(
      [&](std::size_t column, std::uint32_t triangle) { members_[next[column]++] = triangle; });
}

void Solid::SetColumns(int columns) {
  columns_x_ = columns;
  columns_y_ = columns;
  const Eigen::Vector3f size = bounds_.sizes();
  inverse_x_ = size.x() > 0 ? columns / static_cast<double>(size.x()) : 0;
  inverse_y_ = size.y() > 0 ? columns / static_cast<double>(size.y()) : 0;
}

Solid::Columns Solid::ColumnsOf(std::size_t triangle) const {
  Eigen::AlignedBox3f box(Corner(mesh_, triangle, 0));
  box.extend(Corner(mesh_, triangle, 1)).extend(Corner(mesh_, triangle, 2));
  return {Column(box.min().x(), bounds_.min().x(), inverse_x_, columns_x_),
          Column(box.max().x(), bounds_.min().x(), inverse_x_, columns_x_),
          Column(box.min().y(), bounds_.min().y(), inverse_y_, columns_y_),
          Column(box.max().y(), bounds_.min().y(), inverse_y_, columns_y_)};
}

template <typename Visit>
void Solid::ForEachEntry(const Visit& visit) const {
  for (std::size_t t = 0; t < mesh_.triangles.size(); ++t) {
    const Columns columns = ColumnsOf(t);
    for (int y = columns.y0; y <= columns.y1; ++y) {
      for (int x = columns.x0; x <= columns.x1; ++x) {
        visit(static_cast<std::size_t>(y * columns_x_ + x), static_cast<std::uint32_t>(t));
      }
    }
  }
}

int Solid::Column(float x, float low, double inverse_size, int count) const {
  const double scaled = (static_cast<double>(x) - low) * inverse_size;
  return std::clamp(static_cast<int>(scaled), 0, count - 1);
}

int Solid::Winding(const Eigen::Vector3f& point) const {
  if (members_.empty() || point.x() < bounds_.min().x() || point.x() > bounds_.max().x() ||
      point.y() < bounds_.min().y() || point.y() > bounds_.max().y()) {
    return 0;
  }
  const int x = Column(point.x(), bounds_.min().x(), inverse_x_, columns_x_);
  const int y = Column(point.y(), bounds_.min().y(), inverse_y_, columns_y_);
  const auto column = static_cast<std::size_t>(y * columns_x_ + x);
  int winding = 0;
  for (std::size_t m = first_[column]; m < first_[column + 1]; ++m) {
    const std::uint32_t t = members_[m];
    const Eigen::Vector3f& a = Corner(mesh_, t, 0);
    const Eigen::Vector3f& b = Corner(mesh_, t, 1);
    const Eigen::Vector3f& c = Corner(mesh_, t, 2);
    const int side = SideOf(a, b, point);
    if (SideOf(b, c, point) != side || SideOf(c, a, point) != side) continue;
    // Seen along z the triangle holds the point: is it above?
    const Eigen::Vector3d area = AreaVector(mesh_, t);
    if (area.z() == 0) continue;
    const Eigen::Vector3d offset = a.cast<double>() - point.cast<double>();
    const double height = offset.dot(area) / area.z();
    if (height > 0) winding += side;
  }
  return winding;
}

std::vector<std::uint8_t> Solid::Contains(std::span<const Eigen::Vector3f> points) const {
  std::vector<std::uint8_t> inside(points.size(), 0);
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, points.size(), 256), [&](const auto& range) {
    for (std::size_t i = range.begin(); i < range.end(); ++i) {
      inside[i] = Winding(points[i]) > 0 ? 1 : 0;
    }
  });
  return inside;
}

}  // namespace tsdfpp
