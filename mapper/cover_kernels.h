// The bit arithmetic of covers (docs/map.md, "Cover"), a block at a time.
#pragma once

#include "mapper/tsdf_block.h"

namespace tsdfpp {

// The masks of a block (number 13) and of the 26 around it, x fastest, then y, then z; never
// nullptr.
using MasksAround = std::array<const BlockMask*, 27>;

// The slices z of a block from one to another.
struct SliceRange {
  std::size_t first = 0;
  std::size_t last = kBlockSide - 1;
};

// The corners, among the block's voxels of these slices, of crossed cubes. The blocks below are not
// read unless the first slice is among them, those above unless the last one is.
BlockMask CornersOfCrossedCubes(const MasksAround& observed, const MasksAround& negative,
                                const SliceRange& slices);

// The voxels of a block whose `observed` or `negative` changed, but for those that have neighbours
// of one sign only, before and after: these are corners of no crossed cube. What is beyond the
// block may have either sign.
BlockMask ChangedSigns(const BlockMask& old_observed, const BlockMask& old_negative,
                       const BlockMask& observed, const BlockMask& negative);

}  // namespace tsdfpp
