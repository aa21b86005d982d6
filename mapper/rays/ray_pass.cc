#include "mapper/rays/ray_pass.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <bit>

#include "mapper/rays/ray_scene.h"
#include "mapper/rays/tile_cast.h"
#include "mapper/rays/tile_image.h"

namespace tsdfpp {
namespace {

constexpr std::size_t kTilesPerTask = 16;

std::size_t At(int i) { return static_cast<std::size_t>(i); }

// The blocks of each tile, nearest first.
struct TileLists {
  int columns = 0;
  int rows = 0;
  std::vector<std::uint32_t> first;  // by tile, and one past the last
  std::vector<std::uint32_t> block;

  std::span<const std::uint32_t> Of(std::size_t tile) const {
    return {block.data() + first[tile], first[tile + 1] - first[tile]};
  }
};

TileLists ListTiles(const RayBlocks& blocks, const Intrinsics& camera) {
  TileLists lists;
  lists.columns = (camera.width + kTileSide - 1) / kTileSide;
  lists.rows = (camera.height + kTileSide - 1) / kTileSide;
  lists.first.resize(At(lists.columns * lists.rows) + 1, 0);
  const auto for_each_tile = [&](const BlockFootprint& f, const auto& function) {
    for (int v = f.v_low / kTileSide; v <= f.v_high / kTileSide; ++v) {
      for (int u = f.u_low / kTileSide; u <= f.u_high / kTileSide; ++u) {
        function(At(v * lists.columns + u));
      }
    }
  };
  // In the order of depth, so that each tile's list is.
  std::vector<std::uint64_t> order(blocks.size());
  for (std::uint32_t i = 0; i < order.size(); ++i) {
    const BlockFootprint& footprint = blocks.footprints[i];
    order[i] =
        static_cast<std::uint64_t>(std::bit_cast<std::uint32_t>(footprint.near_m)) << 32U | i;
    for_each_tile(footprint, [&](std::size_t tile) { ++lists.first[tile + 1]; });
  }
  std::sort(order.begin(), order.end());
  for (std::size_t tile = 1; tile < lists.first.size(); ++tile) {
    lists.first[tile] += lists.first[tile - 1];
  }
  lists.block.resize(lists.first.back());
  std::vector<std::uint32_t> end(lists.first.begin(), lists.first.end() - 1);
  for (const std::uint64_t key : order) {
    const auto i = static_cast<std::uint32_t>(key);
    for_each_tile(blocks.footprints[i], [&](std::size_t tile) { lists.block[end[tile]++] = i; });
  }
  return lists;
}

}  // namespace

std::vector<RaySurface> RunRayPass(const RayPass& pass, const Intrinsics& camera, const Pose& T_WC,
                                   const RayCastOptions& options) {
  const RayScene scene(pass, camera, T_WC, options);
  const TileLists tiles = ListTiles(scene.blocks, camera);
  std::vector<RaySurface> surfaces = MakeImages(camera, options);
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, tiles.first.size() - 1, kTilesPerTask),
      [&](const tbb::blocked_range<std::size_t>& range) {
        TileRaysOf rays(scene);
        TileCast cast(scene);
        TileImage image(scene);
        for (std::size_t tile = range.begin(); tile != range.end(); ++tile) {
          const auto number = static_cast<int>(tile);
          rays.GoTo(number % tiles.columns * kTileSide, number / tiles.columns * kTileSide);
          const std::vector<TileHits>& hits = cast.Cast(tiles.Of(tile), rays);
          for (std::size_t k = 0; k < hits.size(); ++k) image.Write(hits[k], rays, surfaces[k]);
        }
      },
      tbb::simple_partitioner());
  return surfaces;
}

}  // namespace tsdfpp
