#include "mapper/scene_mesher.h"

#include <algorithm>
#include <cstdlib>
#include <map>
#include <optional>
#include <utility>

#include "mapper/block_surfaces.h"
#include "mapper/mesh/field_mesh.h"
#include "mapper/mesh/mesh_tools.h"
#include "mapper/mesh/volume_meshes.h"

namespace tsdfpp {
namespace {

std::optional<SurfacesInBlocks> SurfacesOf(const MapRepresentation& map) {
  const BlockSurfaces* surfaces = map.block_surfaces();
  if (surfaces == nullptr) return std::nullopt;
  return surfaces->Surfaces();
}

std::size_t BytesOf(const MeshesById& meshes) {
  std::size_t bytes = 0;
  for (const auto& [id, mesh] : meshes) {
    bytes += mesh.vertices.size() * sizeof(mesh.vertices[0]) +
             mesh.colours.size() * sizeof(mesh.colours[0]) +
             mesh.triangles.size() * sizeof(mesh.triangles[0]) +
             mesh.face_ids.size() * sizeof(mesh.face_ids[0]);
  }
  return bytes;
}

bool SameMeshes(const TriangleMesh& a, const TriangleMesh& b) {
  return a.vertices == b.vertices && a.colours == b.colours && a.triangles == b.triangles &&
         a.face_ids == b.face_ids;
}

}  // namespace

struct SceneMesher::Kept {
  // Aborts where it is another method's map than before.
  void CheckMethod(const MapRepresentation& map);
  std::vector<ScenePiece> TakeWholeObjects(const MapRepresentation& map);

  std::optional<Method> method;
  VolumeMeshes volumes;
  FieldMesh field;
  std::optional<MeshesById> field_by_id;  // its scene's, once asked for, until it changes
  MeshesById told;                        // of a map without blocks
};

SceneMesher::SceneMesher() : kept_(std::make_unique<Kept>()) {}
SceneMesher::SceneMesher(SceneMesher&&) noexcept = default;
SceneMesher& SceneMesher::operator=(SceneMesher&&) noexcept = default;
SceneMesher::~SceneMesher() = default;

void SceneMesher::Kept::CheckMethod(const MapRepresentation& map) {
  if (!method) method = map.method();
  if (*method != map.method()) std::abort();
}

MeshWork SceneMesher::Update(const MapRepresentation& map) {
  kept_->CheckMethod(map);
  const auto surfaces = SurfacesOf(map);
  if (!surfaces) return {};
  if (surfaces->field) {
    const MeshWork work =
        kept_->field.Update(*surfaces->field, static_cast<float>(surfaces->voxel_m));
    if (work.changed > 0 || work.remade > 0) kept_->field_by_id.reset();
    return work;
  }
  return kept_->volumes.Update(*surfaces->objects, surfaces->voxel_m);
}

TriangleMesh SceneMesher::SceneMesh(const MapRepresentation& map) {
  kept_->CheckMethod(map);
  const auto surfaces = SurfacesOf(map);
  if (!surfaces) return map.SceneMesh();
  Update(map);
  return surfaces->field ? kept_->field.Scene() : kept_->volumes.Scene();
}

TriangleMesh SceneMesher::ObjectMesh(const MapRepresentation& map, InstanceId id) {
  kept_->CheckMethod(map);
  const auto surfaces = SurfacesOf(map);
  if (!surfaces) return map.ObjectMesh(id);
  if (surfaces->objects) return kept_->volumes.Object(*surfaces->objects, surfaces->voxel_m, id);
  Update(map);
  if (!kept_->field_by_id) kept_->field_by_id = SplitByIds(kept_->field.Scene());
  const auto found = kept_->field_by_id->find(id);
  if (found == kept_->field_by_id->end()) return {};
  TriangleMesh mesh = found->second;
  mesh.face_ids.clear();
  return mesh;
}

SceneChanges SceneMesher::TakeSceneChanges(const MapRepresentation& map) {
  kept_->CheckMethod(map);
  const auto surfaces = SurfacesOf(map);
  if (!surfaces) return {kept_->TakeWholeObjects(map), {}};
  const MeshWork work = Update(map);
  return {surfaces->field ? kept_->field.TakeChanges() : kept_->volumes.TakeChanges(), work};
}

std::vector<ScenePiece> SceneMesher::Kept::TakeWholeObjects(const MapRepresentation& map) {
  MeshesById scene = SplitByIds(map.SceneMesh());
  for (const auto& [id, mesh] : told) scene.try_emplace(id);  // without triangles, if it is gone
  std::vector<ScenePiece> parts;
  for (auto& [id, mesh] : scene) {
    const auto before = told.find(id);
    if (before != told.end() && SameMeshes(before->second, mesh)) continue;
    parts.push_back({id, {}, mesh});
    if (mesh.triangles.empty()) {
      told.erase(id);
    } else {
      told.insert_or_assign(id, std::move(mesh));
    }
  }
  return parts;
}

std::size_t SceneMesher::Bytes() const {
  const std::size_t by_id = kept_->field_by_id ? BytesOf(*kept_->field_by_id) : 0;
  return kept_->volumes.Bytes() + kept_->field.Bytes() + by_id + BytesOf(kept_->told);
}

TriangleMesh AllObjectsMesh(const MapRepresentation& map) {
  TriangleMesh all;
  SceneMesher mesher;
  for (const InstanceId id : map.Objects()) Append(all, mesher.ObjectMesh(map, id), id);
  return all;
}

}  // namespace tsdfpp
