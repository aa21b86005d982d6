// Rays through more than one surface, for any map, the slow way.
#pragma once

#include <functional>
#include <vector>

#include "mapper/index/voxel_labels.h"
#include "mapper/map_representation.h"
#include "mapper/volume/tsdf_block.h"

namespace tsdfpp {

// The n-th surfaces by what they mean, for any map: the rays of copies of it without the objects in
// front. A copy for each set of front objects: slow. Begins with the `front` surfaces (at least
// one); `camera`, `T_WC` and `options` as for MapRepresentation::CastRays.
std::vector<RaySurface> CastByRemoval(const MapRepresentation& map, std::vector<RaySurface> front,
                                      const Intrinsics& camera, const Pose& T_WC,
                                      const RayCastOptions& options);

// Of a map whose visible scene is one field in the world's lattice: its first surfaces by rays
// through that, with labels as RayPass::make_labels, the others by CastByRemoval.
std::vector<RaySurface> CastField(const MapRepresentation& map, const TsdfGrid& field,
                                  const std::function<VoxelLabels()>& make_labels,
                                  const Intrinsics& camera, const Pose& T_WC,
                                  const RayCastOptions& options);

}  // namespace tsdfpp
