// How `tsdf++/literal` fuses a frame: as the paper's sentences say it (docs/map.md; paper III-F).
#pragma once

#include <vector>

#include "mapper/index/pair_index.h"
#include "mapper/volume/volume_fusion.h"

namespace tsdfpp {

// Allocates the index's blocks along the rays, lets the pixels' objects vote in them, allocates
// blocks in the volumes of the objects that are active where a voxel takes an observation, and
// fuses it there. Returns the blocks of the index with such a voxel; some that were allocated may
// list nothing.
std::vector<Index3> FuseIntoActive(const FrameView& frame, const MapConfig& config,
                                   PairIndex& index, ObjectVolumes& volumes);

}  // namespace tsdfpp
