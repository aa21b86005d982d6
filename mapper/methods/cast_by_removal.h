// Rays through more than one surface, for any map, the slow way.
#pragma once

#include <vector>

#include "mapper/map_representation.h"

namespace tsdfpp {

// The n-th surfaces by what they mean, for any map: the rays of copies of it without the objects in
// front. A copy for each set of front objects: slow. Begins with the `front` surfaces (at least
// one); `camera`, `T_WC` and `options` as for MapRepresentation::CastRays.
std::vector<RaySurface> CastByRemoval(const MapRepresentation& map, std::vector<RaySurface> front,
                                      const Intrinsics& camera, const Pose& T_WC,
                                      const RayCastOptions& options);

}  // namespace tsdfpp
