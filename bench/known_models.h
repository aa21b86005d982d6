// Signed distances of true surfaces, so that a tracker can be measured without a map's faults.
#pragma once

#include "core/types.h"
#include "mapper/volume/object_volume.h"

namespace tsdfpp {

// The distance to the surface of a solid, negative within it, at each voxel of the blocks that come
// nearer to the surface than `band_voxels`: exact but for half precision, each as well known as a
// map's can be. Where parts overlap, their hidden surfaces count too. The mesh is in the frame of
// the lattice, metres; its parts must be closed (metrics/solid.h).
TsdfGrid GridOfSolid(const TriangleMesh& mesh_O, double voxel_m, double band_voxels);

}  // namespace tsdfpp
