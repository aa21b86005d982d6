#include "mapper/mesh/marching_cubes.h"

#include <utility>

#include "mapper/mesh/join_parts.h"

namespace tsdfpp {
namespace {

using Table = std::array<std::vector<std::array<CubeEdge, 3>>, 256>;

CubeEdge EdgeBetween(int a, int b) {
  const int difference = a ^ b;
  const int axis = difference == 1 ? 0 : (difference == 2 ? 1 : 2);
  return static_cast<CubeEdge>(3 * std::min(a, b) + axis);
}

// On each face, each run of inside corners is cut off by one segment, so inside corners that are
// diagonal on a face are separated, on both sides of the face alike. The segments join to closed
// loops, which are fanned into triangles.
std::vector<std::array<CubeEdge, 3>> TrianglesOf(unsigned inside) {
  // Corners of each face, counter-clockwise seen from outside the cube.
  constexpr std::array<std::array<int, 4>, 6> kFaces{
      {{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}}};
  std::array<int, 24> next;
  next.fill(-1);
  const auto is_inside = [&](int corner) {
    return ((inside >> static_cast<unsigned>(corner)) & 1U) != 0;
  };
  for (const auto& face : kFaces) {
    for (std::size_t i = 0; i < 4; ++i) {
      const int before = face[i];
      const int first = face[(i + 1) % 4];
      if (is_inside(before) || !is_inside(first)) continue;
      std::size_t last = (i + 1) % 4;
      while (is_inside(face[(last + 1) % 4])) last = (last + 1) % 4;
      const CubeEdge entry = EdgeBetween(before, first);
      const CubeEdge exit = EdgeBetween(face[last], face[(last + 1) % 4]);
      next[entry] = exit;
    }
  }
  std::vector<std::array<CubeEdge, 3>> triangles;
  for (std::size_t start = 0; start < next.size(); ++start) {
    if (next[start] < 0) continue;
    std::vector<CubeEdge> loop;
    for (int at = static_cast<int>(start); next[static_cast<std::size_t>(at)] >= 0;) {
      loop.push_back(static_cast<CubeEdge>(at));
      at = std::exchange(next[static_cast<std::size_t>(at)], -1);
    }
    for (std::size_t i = 2; i < loop.size(); ++i) {
      triangles.push_back({loop[0], loop[i - 1], loop[i]});
    }
  }
  return triangles;
}

const Table& CubeTable() {
  static const Table table = [] {
    Table made;
    for (unsigned inside = 0; inside < made.size(); ++inside) made[inside] = TrianglesOf(inside);
    return made;
  }();
  return table;
}

}  // namespace

const std::vector<std::array<CubeEdge, 3>>& CubeTriangles(unsigned inside_corners) {
  return CubeTable()[inside_corners];
}

TriangleMesh ExtractMesh(const TsdfGrid& grid, float voxel) {
  GridMesh mesh;
  mesh.Update(grid, voxel);
  return Join({{&mesh}});
}

}  // namespace tsdfpp
