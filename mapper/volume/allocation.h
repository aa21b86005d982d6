// Which blocks a frame's surfaces touch (docs/map.md, "Allocation").
#pragma once

#include <functional>
#include <map>
#include <vector>

#include "mapper/map_config.h"
#include "mapper/volume/block_directory.h"
#include "mapper/volume/observation.h"

namespace tsdfpp {

// Where an object's blocks lie.
struct LatticeOfLabel {
  Pose T_WL = Pose::Identity();
  const BlockDirectory* known = nullptr;  // the blocks that are there; nullptr where none is
};

// For each label in the frame, the blocks of that object's lattice along the pixels' rays, in the
// order of Index3, but for those that are known.
std::map<InstanceId, std::vector<Index3>> BlocksAlongRays(
    const FrameView& frame, const MapConfig& config,
    const std::function<LatticeOfLabel(InstanceId)>& lattice_of);

}  // namespace tsdfpp
