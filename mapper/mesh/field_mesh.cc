#include "mapper/mesh/field_mesh.h"

#include "mapper/mesh/join_parts.h"

namespace tsdfpp {

MeshWork FieldMesh::Update(const FieldSurface& surface, float voxel) {
  const MeshWork work = mesh_.Update(*surface.field, voxel);
  LabelTriangles(mesh_, voxel, surface.make_labels);
  return work;
}

TriangleMesh FieldMesh::Scene() const { return Join({{&mesh_}}); }

std::vector<ScenePiece> FieldMesh::TakeChanges() { return TakeScenePieces(mesh_, {&mesh_}); }

}  // namespace tsdfpp
