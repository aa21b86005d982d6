#include "mapper/methods/voxel_map.h"

#include "mapper/scene_mesher.h"

namespace tsdfpp {

TriangleMesh VoxelMap::ObjectMesh(InstanceId id) const {
  return SceneMesher().ObjectMesh(*this, id);
}

TriangleMesh VoxelMap::SceneMesh() const { return SceneMesher().SceneMesh(*this); }

}  // namespace tsdfpp
