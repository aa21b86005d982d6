// Exact distance from points to a triangle mesh (Open3D's RaycastingScene over Embree).
#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <vector>

#include "core/types.h"

namespace tsdfpp {

// What is nearest to each query point, in the order of the queries.
struct NearestSurface {
  static constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();
  std::vector<float> distance_m;          // infinite where the mesh is empty
  std::vector<std::uint32_t> triangle;    // kNone where the mesh is empty
  std::vector<Eigen::Vector3f> normal;    // unit, of that triangle; zero where kNone or degenerate
  std::vector<Eigen::Vector3f> position;  // nearest point of the surface; zero where kNone
};

// An immutable index of one mesh. Distances are point to triangle (facts/metrics.md), single
// precision. Of several triangles at equal distance the index names one of them, of equal ones the
// first. Results do not depend on the number of threads.
class SurfaceIndex {
 public:
  // Triangles with an edge shorter than 5 um are not indexed (Open3D fails on them); the limit
  // grows with `farthest_query_m`, the longest distance that will be asked for.
  explicit SurfaceIndex(TriangleMesh mesh, double farthest_query_m = 80);
  ~SurfaceIndex();
  SurfaceIndex(SurfaceIndex&&) noexcept;
  SurfaceIndex& operator=(SurfaceIndex&&) noexcept;

  // `points` in the mesh's frame, finite; they and the mesh within kFarthest_m (core/farthest.h).
  // Never ask in bulk for points that are equidistant from everything (the centre of a sphere): no
  // hierarchy helps there.
  NearestSurface Nearest(std::span<const Eigen::Vector3f> points) const;

  // Triangles that distances are measured to.
  std::size_t indexed() const;
  const TriangleMesh& mesh() const { return mesh_; }
  // Unit normal a triangle; zero where degenerate.
  const std::vector<Eigen::Vector3f>& normals() const { return normals_; }

 private:
  struct Impl;
  TriangleMesh mesh_;
  std::vector<Eigen::Vector3f> normals_;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tsdfpp
