#include "mapper/mesh/mesh_tools.h"

#include <algorithm>
#include <utility>

namespace tsdfpp {

MeshesById SplitByIds(const TriangleMesh& scene) {
  std::map<InstanceId, std::vector<std::size_t>> faces;
  for (std::size_t i = 0; i < scene.triangles.size(); ++i) faces[scene.face_ids[i]].push_back(i);
  MeshesById meshes;
  std::vector<std::size_t> used_by(scene.vertices.size());  // 1 and up, in the order of ids
  std::vector<std::uint32_t> renamed(scene.vertices.size());
  for (const auto& [id, of] : faces) {
    TriangleMesh& mesh = meshes[id];
    const std::size_t user = meshes.size();
    std::vector<std::uint32_t> used;
    for (const std::size_t i : of) {
      for (const std::uint32_t v : scene.triangles[i]) {
        if (std::exchange(used_by[v], user) != user) used.push_back(v);
      }
    }
    std::sort(used.begin(), used.end());
    for (const std::uint32_t v : used) {
      renamed[v] = static_cast<std::uint32_t>(mesh.vertices.size());
      mesh.vertices.push_back(scene.vertices[v]);
      if (!scene.colours.empty()) mesh.colours.push_back(scene.colours[v]);
    }
    for (const std::size_t i : of) {
      const auto& [a, b, c] = scene.triangles[i];
      mesh.triangles.push_back({renamed[a], renamed[b], renamed[c]});
    }
    mesh.face_ids.assign(of.size(), id);
  }
  return meshes;
}

void Append(TriangleMesh& scene, const TriangleMesh& mesh, InstanceId id) {
  const auto offset = static_cast<std::uint32_t>(scene.vertices.size());
  scene.vertices.insert(scene.vertices.end(), mesh.vertices.begin(), mesh.vertices.end());
  scene.colours.insert(scene.colours.end(), mesh.colours.begin(), mesh.colours.end());
  for (const auto& t : mesh.triangles) {
    scene.triangles.push_back({t[0] + offset, t[1] + offset, t[2] + offset});
    scene.face_ids.push_back(id);
  }
}

}  // namespace tsdfpp
