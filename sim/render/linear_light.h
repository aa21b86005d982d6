// 8-bit sRGB levels and linear light (IEC 61966-2-1).
#pragma once

#include <array>
#include <cstdint>

namespace tsdfpp {

// Light in [0, 1] of each level.
const std::array<float, 256>& LevelToLight();

// The level, 0 to 255 and not rounded, of light in [0, 1]; light outside is clamped.
double LightToLevel(double light);

}  // namespace tsdfpp
