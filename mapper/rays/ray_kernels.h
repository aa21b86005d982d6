// Rays of one image tile through one block, in a loop that is compiled for several instruction sets
// with the same bits from all (docs/map.md, "Ray casting").
#pragma once

#include <array>
#include <cstdint>

#include "mapper/rays/ray_blocks.h"
#include "mapper/rays/tile_order.h"

namespace tsdfpp {

using TileValues = std::array<float, kTilePixels>;

// Directions of a tile's rays in a lattice, voxels per metre of depth, and 1 / them. A component
// near 0 is kept off it.
struct TileRays {
  std::array<TileValues, 3> direction;
  std::array<TileValues, 3> inverse;
};

// A camera before a lattice as rays need it.
struct LatticeRays {
  std::array<double, 3> origin{};     // of the camera, voxels of the lattice
  std::array<float, 3> at_pixel_0{};  // direction through pixel (0, 0)
  std::array<float, 3> per_column{};  // its change a pixel to the right
  std::array<float, 3> per_row{};     // and a pixel down
  std::array<float, 9> R_WL{};        // rows
};

// The rays through the tile whose first pixel is (u, v).
void FillTileRays(const LatticeRays& lattice, int u, int v, TileRays& rays);

// What a tile's rays have met so far.
struct TileHits {
  TileValues depth;  // metres; what is at least as far is not looked for
  std::array<TileValues, 3> normal;
  std::array<std::int32_t, kTilePixels> block;  // its number, -1 for none
};

// Fills a block's distances from those of the block and of the seven further along x, y, z (bits 0,
// 1, 2 of the place).
void CopyCorners(const std::array<const Half*, 8>& from, RayBlock& block);

// Starts to bring a block into the cache: most are met by one tile only once.
void PrefetchBlock(const RayBlock& block);

// Casts the tile's rays through the block's crossed cubes: where a ray passes from outside to
// inside at a depth of at least `from` and less than what it has met so far, that is its first such
// point in this block, and `hits` takes it. `number` is the block's. Returns the largest
// depth in `hits`.
float CastThroughBlock(const RayBlock& block, std::int32_t number, const LatticeRays& lattice,
                       const TileRays& rays, float voxel, const TileValues& from, TileHits& hits);

// The specification of each, in plain C++: the same bytes (mapper/kernels.h).
namespace plain {
decltype(tsdfpp::FillTileRays) FillTileRays;
decltype(tsdfpp::CopyCorners) CopyCorners;
decltype(tsdfpp::CastThroughBlock) CastThroughBlock;
}  // namespace plain

}  // namespace tsdfpp
