#include "mapper/rays/tile_cast.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

namespace tsdfpp {
namespace {

constexpr float kInfinite = std::numeric_limits<float>::infinity();

// Depths are not negative, so their order is that of their bits, which a compiler can compare
// several at a time.
float Farthest(const TileValues& depth) {
  std::int32_t most = 0;
  for (const float value : depth) most = std::max(most, std::bit_cast<std::int32_t>(value));
  return std::bit_cast<float>(most);
}

void Reset(TileHits& hits) {
  hits.depth.fill(kInfinite);
  for (TileValues& component : hits.normal) component.fill(0);
  hits.block.fill(-1);
}

void Copy(const TileHits& from, TileHits& to, std::size_t i) {
  to.depth[i] = from.depth[i];
  to.block[i] = from.block[i];
  for (std::size_t a = 0; a < 3; ++a) to.normal[a][i] = from.normal[a][i];
}

}  // namespace

TileCast::TileCast(const RayScene& scene)
    : scene_(scene),
      voxel_(static_cast<float>(scene.pass.voxel_m)),
      surfaces_(static_cast<std::size_t>(scene.options.surfaces)) {
  from_.fill(static_cast<float>(scene.options.NearestDepth_m()));
  if (scene.pass.make_hidden) hidden_ = scene.pass.make_hidden();
}

const std::vector<TileHits>& TileCast::Cast(std::span<const std::uint32_t> list, TileRaysOf& rays) {
  rays_ = &rays;
  if (scene_.pass.each_alone) {
    CastEachAlone(list);
  } else {
    for (std::size_t k = 0; k < surfaces_.size(); ++k) CastSurface(list, k);
  }
  return surfaces_;
}

float TileCast::Through(std::uint32_t number, const TileValues& from, TileHits& hits) {
  const RayBlock& block = scene_.blocks[number];
  const int lattice = scene_.lattice_of[block.volume];
  return CastThroughBlock(block, static_cast<std::int32_t>(number),
                          scene_.lattices[static_cast<std::size_t>(lattice)], rays_->In(lattice),
                          voxel_, from, hits);
}

InstanceId TileCast::IdOf(const TileHits& hits, std::size_t i) const {
  return scene_.id_of_block[static_cast<std::size_t>(hits.block[i])];
}

// The k-th surface is the first one in the map without the objects of those before.
void TileCast::CastSurface(std::span<const std::uint32_t> list, std::size_t k) {
  TileHits& hits = surfaces_[k];
  Reset(hits);
  if (k > 0) {
    for (std::size_t i = 0; i < kTilePixels; ++i) {
      if (surfaces_[k - 1].block[i] < 0) hits.depth[i] = 0;  // nothing in front: nothing behind
    }
  }
  Sweep(list, k, false, hits);
  if (!scene_.pass.contested) return;
  // Few surfaces are hidden, so that is asked of the nearest ones only; where it is so, the ray
  // is cast again, with the question at every surface.
  if (!AnyHidden(hits, hits.block, k)) return;
  redone_.depth.fill(0);
  redone_.block.fill(-1);
  for (const HiddenQuery& query : queries_) {
    if (query.hidden) redone_.depth[query.pixel] = kInfinite;
  }
  for (TileValues& component : redone_.normal) component.fill(0);
  Sweep(list, k, true, redone_);
  for (std::size_t i = 0; i < kTilePixels; ++i) {
    if (redone_.depth[i] != 0) Copy(redone_, hits, i);
  }
}

// Through the tile's blocks, nearest first. Pixels with a depth of 0 are left out.
void TileCast::Sweep(std::span<const std::uint32_t> list, std::size_t k, bool ask, TileHits& hits) {
  float farthest = Farthest(hits.depth);
  for (std::size_t l = 0; l < list.size(); ++l) {
    const std::uint32_t number = list[l];
    if (scene_.blocks.footprints[number].near_m >= farthest) break;
    if (l + 1 < list.size()) PrefetchBlock(scene_.blocks[list[l + 1]]);
    const TileValues* from = &from_;
    if (k > 0) {
      if (!FillFromLeft(scene_.id_of_block[number], k, hits)) continue;
      from = &from_left_;
    }
    farthest = ask && scene_.blocks[number].contested ? ThroughContested(number, *from, k, hits)
                                                      : Through(number, *from, hits);
  }
}

// Where the rays begin in volumes of an object: nowhere where it is in front. False where no ray
// is left.
bool TileCast::FillFromLeft(InstanceId id, std::size_t k, const TileHits& hits) {
  bool any = false;
  for (std::size_t i = 0; i < kTilePixels; ++i) {
    bool taken_away = hits.depth[i] == 0;
    for (std::size_t n = 0; n < k && !taken_away; ++n) taken_away = IdOf(surfaces_[n], i) == id;
    from_left_[i] = taken_away ? kInfinite : from_[i];
    any = any || !taken_away;
  }
  return any;
}

// Asks of all pixels whose entry in `asked` is not negative whether what they have hit is hidden
// in the map without the objects of their surfaces before k; the answers are in `queries_`.
bool TileCast::AnyHidden(const TileHits& hits, const std::array<std::int32_t, kTilePixels>& asked,
                         std::size_t k) {
  queries_.clear();
  for (std::uint32_t i = 0; i < kTilePixels; ++i) {
    if (asked[i] < 0) continue;
    const auto number = static_cast<std::size_t>(hits.block[i]);
    if (!scene_.blocks[number].contested) continue;
    const Eigen::Vector3f normal(hits.normal[0][i], hits.normal[1][i], hits.normal[2][i]);
    queries_.push_back({scene_.id_of_block[number], i,
                        rays_->PointAt(i, hits.depth[i]) + 0.5F * voxel_ * normal, false});
  }
  if (k == 0) {
    hidden_(queries_, {});
  } else {
    for (HiddenQuery& query : queries_) {
      without_.clear();
      for (std::size_t n = 0; n < k; ++n) without_.push_back(IdOf(surfaces_[n], query.pixel));
      hidden_({&query, 1}, without_);
    }
  }
  return std::any_of(queries_.begin(), queries_.end(),
                     [](const HiddenQuery& query) { return query.hidden; });
}

// Surfaces that are hidden are passed through.
float TileCast::ThroughContested(std::uint32_t number, const TileValues& from, std::size_t k,
                                 TileHits& hits) {
  const float past = 0.05F * voxel_;  // goes on behind a hidden surface
  trial_.depth = hits.depth;
  Through(number, from, trial_);
  for (bool again = true; again;) {
    std::array<std::int32_t, kTilePixels> asked;
    for (std::size_t i = 0; i < kTilePixels; ++i) {
      asked[i] = trial_.depth[i] < hits.depth[i] ? 0 : -1;
    }
    again = AnyHidden(trial_, asked, k);
    trial_from_.fill(kInfinite);
    for (const HiddenQuery& query : queries_) {
      const std::size_t i = query.pixel;
      if (query.hidden) {
        // Far away a step of that length is none.
        trial_from_[i] =
            std::max(trial_.depth[i] + past, std::nextafter(trial_.depth[i], kInfinite));
        trial_.depth[i] = hits.depth[i];
      } else {
        Copy(trial_, hits, i);
      }
    }
    if (again) Through(number, trial_from_, trial_);
  }
  return Farthest(hits.depth);
}

void TileCast::CastEachAlone(std::span<const std::uint32_t> list) {
  for (TileHits& hits : surfaces_) Reset(hits);
  for (std::uint32_t volume = 0; volume < scene_.pass.volumes.size(); ++volume) {
    Reset(trial_);
    float farthest = kInfinite;
    bool any = false;
    for (const std::uint32_t number : list) {
      if (scene_.blocks[number].volume != volume) continue;
      if (scene_.blocks.footprints[number].near_m >= farthest) break;
      any = true;
      farthest = Through(number, from_, trial_);
    }
    if (any) Compete();
  }
}

// The hits of one volume take their places among those of the volumes before.
void TileCast::Compete() {
  for (std::size_t i = 0; i < kTilePixels; ++i) {
    if (trial_.block[i] < 0) continue;
    for (TileHits& hits : surfaces_) {
      if (!(trial_.depth[i] < hits.depth[i])) continue;
      std::swap(trial_.depth[i], hits.depth[i]);
      std::swap(trial_.block[i], hits.block[i]);
      for (std::size_t a = 0; a < 3; ++a) std::swap(trial_.normal[a][i], hits.normal[a][i]);
      if (trial_.block[i] < 0) break;
    }
  }
}

}  // namespace tsdfpp
