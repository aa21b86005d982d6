// The bit arithmetic of covers (docs/map.md, "Cover"), a block at a time.
#pragma once

#include "mapper/tsdf_block.h"

namespace tsdfpp {

// The corners, among the block's voxels, of crossed cubes.
BlockMask CornersOfCrossedCubes(const MasksAround& observed, const MasksAround& negative);

// The voxels of a block whose `observed` or `negative` changed, but for those that have neighbours
// of one sign only, before and after: these are corners of no crossed cube. What is beyond the
// block may have either sign.
BlockMask ChangedSigns(const BlockMask& old_observed, const BlockMask& old_negative,
                       const BlockMask& observed, const BlockMask& negative);

}  // namespace tsdfpp
