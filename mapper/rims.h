// Cubes that are cut by the outline of a mask: their corners beyond it (docs/map.md, "Rims").
#pragma once

#include <vector>

#include "mapper/volume_fusion.h"

namespace tsdfpp {

// The rims of the frame's masks, after it was fused; `fused`, what was changed by that, gets the
// blocks that this changes.
void FuseRims(const FrameView& frame, const MapConfig& config, ObjectVolumes& volumes,
              std::vector<FusedBlock>& fused);

}  // namespace tsdfpp
