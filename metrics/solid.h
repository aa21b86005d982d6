// Which points lie inside a solid bounded by a triangle mesh.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/types.h"

namespace tsdfpp {

// Counts signed crossings of the ray from each point along +z: a winding number, which is also
// right where closed parts overlap (an axle inside a wheel), unlike the parity of crossings or the
// normal of the nearest triangle. Parts must be closed, except sheets that face up (a floor without
// a thickness: below it is inside) or stand upright (a wall: no ray along z crosses it).
class Solid {
 public:
  // Keeps a reference: the mesh must outlive the solid.
  explicit Solid(const TriangleMesh& mesh);

  // 1 where the winding number is positive. Points in the mesh's frame.
  std::vector<std::uint8_t> Contains(std::span<const Eigen::Vector3f> points) const;

 private:
  // Those that a triangle's bounds meet, inclusive.
  struct Columns {
    int x0, x1, y0, y1;
    std::size_t Count() const {
      return static_cast<std::size_t>(x1 - x0 + 1) * static_cast<std::size_t>(y1 - y0 + 1);
    }
  };
  void SetColumns(int columns);
  Columns ColumnsOf(std::size_t triangle) const;
  template <typename Visit>
  void ForEachEntry(const Visit& visit) const;
  int Winding(const Eigen::Vector3f& point) const;
  int Column(float x, float low, double inverse_size, int count) const;

  const TriangleMesh& mesh_;
  // Triangles by the columns of a grid in x and y that their bounds meet.
  Eigen::AlignedBox3f bounds_;
  int columns_x_ = 0;
  int columns_y_ = 0;
  double inverse_x_ = 0;
  double inverse_y_ = 0;
  std::vector<std::size_t> first_;
  std::vector<std::uint32_t> members_;
};

}  // namespace tsdfpp
