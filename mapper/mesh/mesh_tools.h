// Small operations on triangle meshes.
#pragma once

#include <map>

#include "core/types.h"
#include "mapper/volume/block_grid.h"

namespace tsdfpp {

using MeshesById = std::map<InstanceId, TriangleMesh>;
// The triangles of each id with the vertices that they use, in order; with face ids. Costs what the
// scene's triangles do, however many ids there are.
MeshesById SplitByIds(const TriangleMesh& scene);
// Appends a coloured mesh without face ids as faces of `id`.
void Append(TriangleMesh& scene, const TriangleMesh& mesh, InstanceId id);
// The voxel whose centre is nearest to a point, along an axis; both in metres.
inline int NearestAlong(float x, float voxel) {
  // The floor, without a call.
  const float place = x / voxel + 0.5F;
  const int cut = static_cast<int>(place);
  return cut - static_cast<int>(static_cast<float>(cut) > place);
}
inline Index3 NearestVoxel(const Eigen::Vector3f& point, float voxel) {
  return {NearestAlong(point.x(), voxel), NearestAlong(point.y(), voxel),
          NearestAlong(point.z(), voxel)};
}

}  // namespace tsdfpp
