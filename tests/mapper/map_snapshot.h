// All that a map says, as bytes.
#pragma once

#include <string>
#include <vector>

#include "mapper/map_representation.h"
#include "mapper/voxel_inspection.h"

namespace tsdfpp {

template <typename T>
void AppendBytes(const T& value, std::string& bytes) {
  bytes.append(reinterpret_cast<const char*>(&value), sizeof(T));
}

inline void AppendMesh(const TriangleMesh& mesh, std::string& bytes) {
  for (const auto& vertex : mesh.vertices) {
    for (int a = 0; a < 3; ++a) AppendBytes(vertex[a], bytes);
  }
  for (const auto& triangle : mesh.triangles) AppendBytes(triangle, bytes);
  for (const auto& colour : mesh.colours) AppendBytes(colour, bytes);
  for (const auto& id : mesh.face_ids) AppendBytes(id, bytes);
}

// Voxels, lists and meshes.
inline std::string SnapshotOf(const MapRepresentation& map, const std::vector<InstanceId>& ids) {
  std::string bytes;
  for (const InstanceId id : ids) {
    for (const Eigen::Vector3i& v : VoxelsOf(map).ObservedVoxels(id)) {
      const auto value = VoxelsOf(map).ValueAt(id, v);
      for (int a = 0; a < 3; ++a) AppendBytes(v[a], bytes);
      AppendBytes(value->distance_m, bytes);
      AppendBytes(value->weight, bytes);
      AppendBytes(value->colour, bytes);
    }
    AppendMesh(map.ObjectMesh(id), bytes);
  }
  for (const Eigen::Vector3i& v : VoxelsOf(map).ListedVoxels()) {
    for (int a = 0; a < 3; ++a) AppendBytes(v[a], bytes);
    for (const Listing& entry : VoxelsOf(map).ListAt(v)) {
      AppendBytes(entry.id, bytes);
      AppendBytes(entry.confidence, bytes);
    }
  }
  AppendMesh(map.SceneMesh(), bytes);
  return bytes;
}

}  // namespace tsdfpp
