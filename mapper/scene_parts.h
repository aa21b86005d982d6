// From the cached parts of one or more grids to one mesh: placed in the world, labelled, without
// what is hidden (docs/map.md, "Scene mesh of both").
#pragma once

#include <functional>
#include <vector>

#include "mapper/mesh_cache.h"

namespace tsdfpp {

// The mesh of an object's volume and where it stands. A copy starts empty.
struct PlacedMesh {
  GridMesh mesh;
  Pose T_WL = Pose::Identity();
  bool lattice_is_world = true;
  std::uint64_t version = 0;  // a new one after each update that found a change

  // Brings the mesh in line with the grid and stands it at T_WL.
  MeshWork Update(const TsdfGrid& grid, float voxel, const Pose& T_WL_now, bool is_world_now);
};

// Blocks of the global lattice, both ends included.
struct BlockBox {
  Index3 low;
  Index3 high;
  bool is_empty = true;

  void Extend(const Index3& index);
  bool Holds(const Index3& index) const;
};

// Where triangles of other objects may have a look-up voxel that this object covers: the blocks
// around those that hold a negative voxel.
BlockBox ReachOf(const PlacedMesh& object, double voxel_m);

// Whether a triangle is hidden, from its three corners in the world.
using IsHidden =
    std::function<bool(const Eigen::Vector3f&, const Eigen::Vector3f&, const Eigen::Vector3f&)>;

// Finds out which triangles of the parts that `in_doubt` names are hidden; no other one is.
void HideTriangles(const GridMesh& mesh, const std::function<bool(const MeshPart&)>& in_doubt,
                   const IsHidden& is_hidden);

// Labels the triangles of the parts whose values changed by what `label_at` says of their centroids
// in the lattice, in metres.
void LabelTriangles(const GridMesh& mesh,
                    const std::function<InstanceId(const Eigen::Vector3f&)>& label_at);

// One of the meshes that are put together.
struct JoinedMesh {
  const GridMesh* mesh = nullptr;
  InstanceId id = kNoInstance;  // of all its faces; kNoInstance: those of its parts, where labelled
  bool visible_only = false;    // as HideTriangles found
};

// The meshes one after the other, block after block; vertices that no triangle names are left out.
TriangleMesh Join(const std::vector<JoinedMesh>& meshes);

}  // namespace tsdfpp
