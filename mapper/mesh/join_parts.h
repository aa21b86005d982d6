// From the cached parts of one or more grids to one mesh, or to a mesh a block, without what is
// hidden (docs/map.md, "Scene mesh of both").
#pragma once

#include <vector>

#include "mapper/mesh/mesh_cache.h"
#include "mapper/mesh/scene_changes.h"

namespace tsdfpp {

// One of the meshes that are put together.
struct JoinedMesh {
  const GridMesh* mesh = nullptr;
  InstanceId id = kNoInstance;  // of all its faces; kNoInstance: those of its parts, where labelled
  bool visible_only = false;    // as HideTriangles found
};

// What changed of a mesh since this was last asked of it, everything the first time: by block, the
// parts that are no longer there among them, without triangles. They have the id of `of`.
std::vector<ScenePiece> TakeScenePieces(GridMesh& mesh, const JoinedMesh& of);

// The meshes one after the other, block after block; vertices that no triangle names are left out.
TriangleMesh Join(const std::vector<JoinedMesh>& meshes);

}  // namespace tsdfpp
