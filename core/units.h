// Factors between the units that every room computes in and those that people read and write.
#pragma once

#include <numbers>

namespace tsdfpp {

inline constexpr double kDegree = std::numbers::pi / 180;  // radians
inline constexpr double kDegPerRad = 180 / std::numbers::pi;
inline constexpr double kCm2PerM2 = 1e4;

}  // namespace tsdfpp
