#include "mapper/mesh/mesh_tools.h"

namespace tsdfpp {

// The triangles for which keep[i] is set, and the vertices they use.
TriangleMesh KeepFaces(const TriangleMesh& mesh, const std::vector<std::uint8_t>& keep) {
  TriangleMesh kept;
  constexpr std::uint32_t kUnused = ~0U;
  std::vector<std::uint32_t> renamed(mesh.vertices.size(), kUnused);
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    if (keep[i] == 0) continue;
    for (const std::uint32_t v : mesh.triangles[i]) renamed[v] = 0;
  }
  for (std::size_t v = 0; v < renamed.size(); ++v) {
    if (renamed[v] == kUnused) continue;
    renamed[v] = static_cast<std::uint32_t>(kept.vertices.size());
    kept.vertices.push_back(mesh.vertices[v]);
    if (!mesh.colours.empty()) kept.colours.push_back(mesh.colours[v]);
  }
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    if (keep[i] == 0) continue;
    const auto& t = mesh.triangles[i];
    kept.triangles.push_back({renamed[t[0]], renamed[t[1]], renamed[t[2]]});
    if (!mesh.face_ids.empty()) kept.face_ids.push_back(mesh.face_ids[i]);
  }
  return kept;
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
