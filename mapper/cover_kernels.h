// The bit arithmetic of covers (docs/map.md, "Cover"), a block at a time.
#pragma once

#include "mapper/tsdf_block.h"

namespace tsdfpp {

// The corners, among the block's voxels, of crossed cubes.
BlockMask CornersOfCrossedCubes(const MasksAround& observed, const MasksAround& negative);

}  // namespace tsdfpp
