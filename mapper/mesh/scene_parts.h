// What the scene adds to the cached parts of a grid's mesh: where they are in the world, which
// triangles are hidden, which object each is of (docs/map.md, "Scene mesh of both").
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "mapper/index/voxel_labels.h"
#include "mapper/mesh/mesh_cache.h"
#include "mapper/volume/object_volume.h"

namespace tsdfpp {

// The mesh of an object's volume and where it stands.
struct PlacedMesh {
  GridMesh mesh;
  Pose T_WL = Pose::Identity();
  bool lattice_is_world = true;
  BlockBox negative;  // of the lattice: at least the blocks that hold a negative voxel

  // What happened since somebody last reset these: in blocks of the lattice.
  std::vector<Index3> changed;
  bool has_moved = true;

  // Makes `negative` as small as it can be.
  void FindNegative();

  // Brings the mesh in line with the volume's grid and pose; `voxel` in metres.
  MeshWork Update(const ObjectVolume& volume, float voxel);
};

// Where triangles of other objects may have a look-up voxel that this object covers, and where its
// own have theirs: the blocks around those that hold a negative voxel.
BlockBox ReachOf(const PlacedMesh& object, double voxel_m);

// The parts of the set's blocks.
std::vector<MeshPart*> PartsIn(const BlockSet& blocks, const GridMesh& mesh);

// Where it is looked up whether a triangle is hidden, in voxels of the world: half a voxel in front
// of its centroid, and the voxel nearest to that.
struct LookUpPlace {
  Index3 voxel;
  Eigen::Vector3f point;
};

// Which triangles are hidden, from where they are looked up: 1 for those, 0 for the others. Returns
// IdBit of all objects whose values say it. For several threads at once.
using HiddenAt =
    std::function<std::uint64_t(std::span<const LookUpPlace>, std::span<std::uint8_t>)>;

// Finds out which triangles of some parts of the mesh are hidden: of those whose global blocks, by
// `place_of`, are `in_doubt`; no others are. `voxel` in metres.
// Returns the parts of which other triangles are visible than before, or whose triangles were made
// again.
std::vector<MeshPart*> HideTriangles(const std::vector<MeshPart*>& parts, float voxel,
                                     const std::function<BlockBox(const MeshPart&)>& place_of,
                                     const std::function<bool(const BlockBox&)>& in_doubt,
                                     const HiddenAt& hidden_at);

// Labels the triangles of the parts whose values changed by what labels of each part's own say of
// the voxels nearest to their centroids in the lattice; `voxel` in metres.
void LabelTriangles(GridMesh& mesh, float voxel, const std::function<VoxelLabels()>& make_labels);

}  // namespace tsdfpp
