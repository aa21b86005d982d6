// Which triangles of a layered map's objects are visible, from the interface alone.
#pragma once

#include <array>
#include <optional>
#include <set>

#include "mapper/map_representation.h"
#include "mapper/voxel_inspection.h"
#include "tests/mapper/mesh_checks.h"
#include "tests/mapper/toy_scene.h"

namespace tsdfpp {

// The distance of an object at a point of the world, from the interface alone; nothing where a
// corner that counts is unobserved.
inline std::optional<float> DistanceAtGlobal(const MapRepresentation& map, InstanceId id,
                                             const Eigen::Vector3d& p_W) {
  const reference::Neighbourhood place(map.ObjectLattice(id).inverse() * p_W / kToyVoxel_m);
  std::array<float, 8> distances{};
  for (int i = 0; i < 8; ++i) {
    if (place.Coefficient(i) == 0) continue;
    const auto value = VoxelsOf(map).ValueAt(id, reference::CubeCorner(place.base, i));
    if (!value) return std::nullopt;
    distances[i] = value->distance_m;
  }
  return place.Interpolate(distances);
}

using Triangle = std::array<float, 10>;  // id, then three vertices

inline Triangle AsTriangle(const TriangleMesh& mesh, std::size_t t, InstanceId id) {
  Triangle triangle{static_cast<float>(id)};
  for (int i = 0; i < 9; ++i) triangle[1 + i] = mesh.vertices[mesh.triangles[t][i / 3]][i % 3];
  return triangle;
}

// docs/map.md, "Scene mesh of both", said again.
inline std::multiset<Triangle> VisibleTriangles(const MapRepresentation& map) {
  std::multiset<Triangle> visible;
  for (const InstanceId id : map.Objects()) {
    const TriangleMesh mesh = map.ObjectMesh(id);
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
      const Eigen::Vector3d p =
          CentroidOf(mesh, t) + 0.5 * kToyVoxel_m * NormalOf(mesh, t).normalized();
      const Eigen::Vector3d nearest =
          (p / kToyVoxel_m + Eigen::Vector3d::Constant(0.5)).array().floor();
      const Eigen::Vector3i v = nearest.cast<int>();
      const auto list = VoxelsOf(map).ListAt(v);
      const bool other = !list.empty() && list[0].id != id;
      const bool hidden = other && DistanceAtGlobal(map, list[0].id, p).value_or(0) < -kToyVoxel_m;
      if (!hidden) visible.insert(AsTriangle(mesh, t, id));
    }
  }
  return visible;
}

// The triangles of a mesh with face ids.
inline std::multiset<Triangle> TrianglesOf(const TriangleMesh& mesh) {
  std::multiset<Triangle> triangles;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    triangles.insert(AsTriangle(mesh, t, mesh.face_ids[t]));
  }
  return triangles;
}

}  // namespace tsdfpp
