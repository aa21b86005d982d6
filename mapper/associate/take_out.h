// What was fused into an object under a wrong label, taken out of it again.
#pragma once

#include <optional>
#include <vector>

#include "core/types.h"
#include "mapper/map_representation.h"
#include "mapper/volume/block_grid.h"

namespace tsdfpp {

// Beyond a cell so much goes with it, voxels: what a surface in the cell lies between.
inline constexpr double kBesideCell_voxels = 0.5;

// Takes the voxels in and around the cells (of side `cell_m`, of the object's frame, which is at
// T_WO, or the world's where it has no pose yet) out of the object, which keeps its pose. Nothing
// where the map has no volume of the object alone, or it is the background.
void TakeOut(const std::vector<Index3>& cells, double cell_m, InstanceId object,
             const std::optional<Pose>& T_WO, MapRepresentation& map);

}  // namespace tsdfpp
