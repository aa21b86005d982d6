// How far from the origin anything may lie that comes from data.
#pragma once

namespace tsdfpp {

// Metres along an axis. Neighbouring numbers of single precision are a metre apart there, and
// squares of distances beyond 1e19 have no number in it. Maps have a narrower range of their own.
inline constexpr double kFarthest_m = 1e7;

}  // namespace tsdfpp
