// Fusion of a frame into object volumes, all objects in one pass (docs/map.md; paper III-F).
#pragma once

#include <map>
#include <memory>
#include <vector>

#include "mapper/map_config.h"
#include "mapper/volume/fuse_voxel.h"
#include "mapper/volume/object_volume.h"
#include "mapper/volume/observation.h"

namespace tsdfpp {

// Ordered, so that every walk over the objects is in increasing id.
using ObjectVolumes = std::map<InstanceId, ObjectVolume>;

// A block that the frame changed.
struct FusedBlock {
  InstanceId id = kNoInstance;
  Index3 index;
  std::uint32_t number = 0;  // in the grid's entries()
  TsdfBlock* block = nullptr;
  const BlockMask* votes = nullptr;  // in what FuseIntoVolumes was given, or nullptr
  // Of the block (bit 0) and those one step back along x, y, z (bits 0, 1, 2 of the bit's number):
  // which may have a cube that is crossed anew, or no longer.
  std::uint8_t stale_cubes = 0;
  bool band_changed = false;
  bool is_listed_with_others = false;  // of the block
  bool is_empty = false;               // no voxel is observed
};

// See FusedBlock::stale_cubes: the blocks with a cube of which one of the voxels is a corner.
std::uint8_t BlocksOfCubesAt(const BlockMask& voxels);

// Of each fused block, the voxels with an observation of its object in band.
using BlockVotes = std::unique_ptr<BlockMask[]>;

// Allocates the blocks of the labels in the frame (making volumes for new labels), fuses, applies
// the contradiction rule if the config asks for it, completes rims, and returns the blocks in
// which a voxel changed. Their masks are up to date but for `crossed` and `cover`. `votes`, where
// given, must outlive them.
std::vector<FusedBlock> FuseIntoVolumes(const FrameView& frame, const MapConfig& config,
                                        ObjectVolumes& volumes, BlockVotes* votes = nullptr);

}  // namespace tsdfpp
