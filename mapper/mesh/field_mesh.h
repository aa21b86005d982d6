// The kept mesh of one field with labels.
#pragma once

#include "mapper/mesh/scene_parts.h"
#include "mapper/mesh/surfaces_in_blocks.h"

namespace tsdfpp {

class FieldMesh {
 public:
  // Brings the mesh in line with the field; `voxel` in metres. A part is labelled anew where values
  // in it or beside it changed: whoever changes a label gives its block a new revision.
  MeshWork Update(const FieldSurface& surface, float voxel);

  // As of the last update: all of it, with face ids; what changed since this was last asked.
  TriangleMesh Scene() const;
  std::vector<ScenePiece> TakeChanges();

  std::size_t Bytes() const { return mesh_.Bytes(); }

 private:
  GridMesh mesh_;
};

}  // namespace tsdfpp
