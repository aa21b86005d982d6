// Which blocks of a volume a camera cannot see, wherever they are in the volume's lattice.
#pragma once

#include "core/types.h"
#include "mapper/volume/block_grid.h"

namespace tsdfpp {

// Whether all voxels of a block (of a lattice L, at the camera by T_CL) fall beside the picture or
// are behind the camera. By the ball around them: of a block near the picture's edge it may be
// false though none is in view.
bool IsOutOfView(const Index3& block, const Pose& T_CL, double voxel_m, const Intrinsics& camera);

}  // namespace tsdfpp
