// Says whose the surface at some voxels is.
#pragma once

#include <functional>
#include <span>

#include "core/types.h"
#include "mapper/volume/last_block.h"

namespace tsdfpp {

// The object of each voxel of one lattice. It may remember what it looked up last, so each thread
// has one of its own.
using VoxelLabels = std::function<void(std::span<const Index3> voxels, std::span<InstanceId> ids)>;

// By what `id_at(block, place)` says of the blocks of a grid, the background where that is
// kNoInstance or there is no block. The grid must not change meanwhile.
template <typename Block, typename IdAt>
VoxelLabels LabelsOf(const BlockGrid<Block>& grid, const IdAt& id_at) {
  // One voxel after another is in the same block.
  return [last = LastBlock(grid), id_at](std::span<const Index3> voxels,
                                         std::span<InstanceId> ids) mutable {
    for (std::size_t i = 0; i < voxels.size(); ++i) {
      const Block* block = last.Find(BlockOf(voxels[i]));
      const InstanceId id = block == nullptr
                                ? kNoInstance
                                : id_at(*block, static_cast<std::size_t>(PlaceInBlock(voxels[i])));
      ids[i] = id == kNoInstance ? kBackground : id;
    }
  };
}

}  // namespace tsdfpp
