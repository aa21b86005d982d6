// A map of voxels, as all those here are but the surfels: it can do what only some maps can.
#pragma once

#include "mapper/block_moves.h"
#include "mapper/block_surfaces.h"
#include "mapper/map_editing.h"
#include "mapper/map_persistence.h"
#include "mapper/map_representation.h"
#include "mapper/voxel_inspection.h"

namespace tsdfpp {

class VoxelMap : public MapRepresentation,
                 public VoxelInspection,
                 public MapEditing,
                 public MapPersistence,
                 public BlockMoves,
                 public BlockSurfaces {
 public:
  const VoxelInspection* inspection() const final { return this; }
  MapEditing* editing() final { return this; }
  const MapPersistence* persistence() const final { return this; }
  MapPersistence* persistence() final { return this; }
  const BlockMoves* block_moves() const final { return this; }
  const BlockSurfaces* block_surfaces() const final { return this; }
  TriangleMesh ObjectMesh(InstanceId id) const final;
  TriangleMesh SceneMesh() const final;
};

}  // namespace tsdfpp
