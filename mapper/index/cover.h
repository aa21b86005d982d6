// Which voxels of a block its object covers (docs/map.md, "Cover"), at the lattice points.
#pragma once

#include <vector>

#include "mapper/volume/volume_fusion.h"

namespace tsdfpp {

// The cover of a block, from the masks of the blocks around it: band, or corner of a crossed cube.
BlockMask FindCover(const TsdfGrid& grid, const Index3& block);

// Brings `crossed` and `cover` of all blocks of the grid in line with their other masks.
void RenewCovers(const TsdfGrid& grid);

// A block whose cover changed in a frame.
struct CoverChange {
  InstanceId id = kNoInstance;
  Index3 index;
  BlockMask lost{};
  BlockMask gained{};
};

// Brings TsdfBlock::crossed and cover up to date after a frame, in the volumes whose lattice is the
// world's and whose covers were up to date before it. Returns what changed, by id, each block once.
std::vector<CoverChange> UpdateCovers(const std::vector<FusedBlock>& fused,
                                      const ObjectVolumes& volumes);

}  // namespace tsdfpp
