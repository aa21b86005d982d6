// The map as seen from a pose, as pictures: what is visible, and what is behind it.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "mapper/map_representation.h"

namespace tsdfpp {

// Writes for the k-th surface along each ray, k = 1 ... surfaces (MapRepresentation::CastRays),
// below `folder`: colour-k.png; depth-k.exr (metres along the optical axis, 0 where there is none);
// normal-k.png (red, green, blue = 127.5 (1 + x), ... in the world's frame; black where there is
// none); id-k.png (16 bits, 65535 where there is none). Errors: kEnvironment where a codec fails or
// the disk refuses.
Expected<void> WriteViews(const MapRepresentation& map, const Intrinsics& camera, const Pose& T_WC,
                          int surfaces, const std::filesystem::path& folder);

// The names of the files that it writes.
std::vector<std::string> ViewFiles(int surfaces);

}  // namespace tsdfpp
