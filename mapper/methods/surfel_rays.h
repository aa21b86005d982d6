// Images of lists of surfels from any pose (docs/map.md, "`surfels`").
#pragma once

#include <vector>

#include "mapper/methods/surfel_list.h"
#include "mapper/rays/ray_cast.h"

namespace tsdfpp {

// MapRepresentation::CastRays: of each object the stable disc that a ray meets first, and of these
// the options.surfaces nearest ones; ties by id, then by place in the list.
std::vector<RaySurface> CastSurfels(const SurfelObjects& objects, const Intrinsics& camera,
                                    const Pose& T_WC, const RayCastOptions& options);

}  // namespace tsdfpp
