// Which points lie inside a solid bounded by a triangle mesh.
#pragma once

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
  int Winding(const Eigen::Vector3f& point) const;
  int Column(float x, float low, double inverse_size, int count) const;

  const TriangleMesh& mesh_;
  // Triangles by the columns of a grid in x and y that their bounds meet.
  Eigen::AlignedBox3f bounds_;
  int columns_x_ = 0;
  int columns_y_ = 0;
  double inverse_x_ = 0;
  double inverse_y_ = 0;
  std::vector<std::uint32_t> first_;
  std::vector<std::uint32_t> members_;
};

}  // namespace tsdfpp
