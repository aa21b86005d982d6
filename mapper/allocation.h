// Which blocks a frame's surfaces touch (docs/map.md, "Allocation").
#pragma once

#include <functional>
#include <map>
#include <vector>

#include "mapper/map_config.h"
#include "mapper/observation.h"

namespace tsdfpp {

// For each label in the frame, the blocks of that object's lattice along the pixels' rays, in the
// order of Index3, but for those that `is_known`. `T_WL_of` gives the lattice of an object in the
// world (the identity where it is the world's).
std::map<InstanceId, std::vector<Index3>> BlocksAlongRays(
    const FrameView& frame, const MapConfig& config, const std::function<Pose(InstanceId)>& T_WL_of,
    const std::function<bool(InstanceId, const Index3&)>& is_known);

}  // namespace tsdfpp
