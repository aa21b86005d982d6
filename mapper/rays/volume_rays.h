// Rays through object volumes, of which one may hide another (docs/map.md, "Ray casting").
#pragma once

#include <vector>

#include "mapper/mesh/surfaces_in_blocks.h"
#include "mapper/rays/ray_cast.h"

namespace tsdfpp {

// What is visible as for the scene mesh: where the index lists another object as active, and the
// surface lies deep enough in that. The n-th surface is the first one of the map without the
// objects of the n - 1 before it, as far as the index knows who comes next. Without an index each
// volume is cast by itself, and the nearest surface wins. Arguments as for
// MapRepresentation::CastRays.
std::vector<RaySurface> CastThroughVolumes(const VolumeSurfaces& surfaces, double voxel_m,
                                           const Intrinsics& camera, const Pose& T_WC,
                                           const RayCastOptions& options);

}  // namespace tsdfpp
