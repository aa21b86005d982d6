// What a frame tells before its voxels are looked at: tiles of its images, and the blocks along the
// rays of its pixels (docs/map.md, "Allocation").
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "core/types.h"

namespace tsdfpp {

struct KernelFrame;

// What the pixels of a square of the image hold.
inline constexpr int kTile_px = 16;
struct Tile {
  float nearest = std::numeric_limits<float>::infinity();  // metres, of the valid depths
  float farthest = 0;
  std::uint16_t least_label = kNoInstance;  // of all pixels
  std::uint16_t greatest_label = 0;
};

// The tiles of row `row` of tiles, from left to right.
void SummariseTiles(const KernelFrame& frame, int row, Tile* tiles);

// Points at the ranges min(first + step * i, last), in the units of the ray's direction.
struct RayRanges {
  double first = 0;
  double step = 0;
  double last = 0;
};

// The blocks, as PackIndex() packs them, of the voxels nearest to `count` points of a ray,
// origin + direction * range in voxels of the lattice. Whole vectors are written: `keys` has room
// for `count` + kKeysPerStep.
inline constexpr std::size_t kKeysPerStep = 8;
void BlocksAtPoints(const std::array<double, 3>& origin, const std::array<double, 3>& direction,
                    const RayRanges& ranges, std::size_t count, std::uint64_t* keys);

}  // namespace tsdfpp
