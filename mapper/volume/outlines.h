// The pixels near an object's outline, where rims are looked for (rims.h).
#pragma once

#include <cstdint>
#include <vector>

#include "mapper/volume/observation.h"

namespace tsdfpp {

// The pixels, a byte each, 1 or 0, that are as near to an outline of their own object as a voxel of
// a cube in which the outline lies may be seen. An object has no outline where it is two voxels or
// more in front of what is beside it: it ends there, and what its surface goes on to is out of
// sight.
std::vector<std::uint8_t> PixelsAtOutlines(const FrameView& frame, double voxel_m);

}  // namespace tsdfpp
