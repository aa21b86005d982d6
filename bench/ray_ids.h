// What casting rays through the same visible geometry costs when it is split into more objects: the
// paper's claim about scaling.
#pragma once

#include <string>
#include <vector>

#include "core/types.h"
#include "mapper/map_config.h"

namespace tsdfpp {

// Of one map, by kSplitSides: the least milliseconds of a cast, wall clock and CPU.
struct SplitTiming {
  std::string name;
  std::vector<double> wall_ms;
  std::vector<double> cpu_ms;
  std::vector<double> hit;  // share of the image's pixels: the geometry is the same
};

inline constexpr int kSplitSides[] = {1, 2, 4, 8};  // ids are the cells of a grid over the ground

// Fuses the first frames (at most 8, in which nothing should move far) under 1, 4, 16 and 64 ids
// and casts rays from the last one, `repeats` times in turn. "Moved" are maps whose lattices
// are all turned by a hair, so that none is the world's.
std::vector<SplitTiming> CastSplitIds(const std::vector<Frame>& frames, const MapConfig& config,
                                      int repeats);

}  // namespace tsdfpp
