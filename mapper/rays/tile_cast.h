// The surfaces along the rays of one image tile after another.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "mapper/rays/ray_scene.h"

namespace tsdfpp {

class TileCast {
 public:
  explicit TileCast(const RayScene& scene);

  // Casts the rays of the tile at which `rays` is through the blocks of the list, nearest first.
  // The result, by TileOrder: a TileHits a surface along each ray, until the next call.
  const std::vector<TileHits>& Cast(std::span<const std::uint32_t> list, TileRaysOf& rays);

 private:
  float Through(std::uint32_t number, const TileValues& from, TileHits& hits);
  InstanceId IdOf(const TileHits& hits, std::size_t i) const;
  void CastSurface(std::span<const std::uint32_t> list, std::size_t k);
  void Sweep(std::span<const std::uint32_t> list, std::size_t k, bool ask, TileHits& hits);
  bool FillFromLeft(InstanceId id, std::size_t k, const TileHits& hits);
  bool AnyHidden(const TileHits& hits, const std::array<std::int32_t, kTilePixels>& asked,
                 std::size_t k);
  float ThroughContested(std::uint32_t number, const TileValues& from, std::size_t k,
                         TileHits& hits);
  void CastEachAlone(std::span<const std::uint32_t> list);
  void Compete();

  const RayScene& scene_;
  TileRaysOf* rays_ = nullptr;  // during a call of Cast()
  float voxel_;
  std::vector<TileHits> surfaces_;
  TileHits trial_;
  TileHits redone_;
  TileValues from_;
  TileValues from_left_;
  TileValues trial_from_;
  std::vector<InstanceId> without_;
  RayPass::Hidden hidden_;
  std::vector<HiddenQuery> queries_;
};

}  // namespace tsdfpp
