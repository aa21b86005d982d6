#include "mapper/rays/ray_pass.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdlib>
#include <limits>

#include "mapper/mesh/mesh_tools.h"
#include "mapper/rays/ray_kernels.h"
#include "mapper/volume/object_volume.h"

namespace tsdfpp {
namespace {

constexpr std::size_t kTilesPerTask = 16;
constexpr int kRun = 4;  // pixels of a row that TileOrder keeps together
constexpr float kInfinite = std::numeric_limits<float>::infinity();

std::size_t At(int i) { return static_cast<std::size_t>(i); }

// Rays through the pixels, in one lattice.
LatticeRays RaysIn(const RayVolume& volume, const RayCamera& camera, double voxel_m) {
  const Pose T_LC =
      volume.lattice_is_world ? camera.T_WC : Pose(volume.T_WL.inverse() * camera.T_WC);
  const Intrinsics& k = camera.intrinsics;
  const Eigen::Matrix3d R = T_LC.linear() / voxel_m;
  const Eigen::Vector3d origin = T_LC.translation() / voxel_m;
  const Eigen::Vector3d at_0 = R * Eigen::Vector3d(-k.cx / k.fx, -k.cy / k.fy, 1);
  const Eigen::Vector3d column = R.col(0) / k.fx;
  const Eigen::Vector3d row = R.col(1) / k.fy;
  LatticeRays rays;
  for (int a = 0; a < 3; ++a) {
    rays.origin[At(a)] = origin[a];
    rays.at_pixel_0[At(a)] = static_cast<float>(at_0[a]);
    rays.per_column[At(a)] = static_cast<float>(column[a]);
    rays.per_row[At(a)] = static_cast<float>(row[a]);
    for (int c = 0; c < 3; ++c) {
      rays.R_WL[At(3 * a + c)] = static_cast<float>(volume.T_WL.linear()(a, c));
    }
  }
  return rays;
}

// The blocks of each tile, nearest first.
struct TileLists {
  int columns = 0;
  int rows = 0;
  std::vector<std::uint32_t> first;  // by tile, and one past the last
  std::vector<std::uint32_t> block;
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

// Depths are not negative, so their order is that of their bits, which a compiler can compare
// several at a time.
float Farthest(const TileValues& depth) {
  std::int32_t most = 0;
  for (const float value : depth) most = std::max(most, std::bit_cast<std::int32_t>(value));
  return std::bit_cast<float>(most);
}

class Caster {
 public:
  Caster(const RayPass& pass, const Intrinsics& camera, const Pose& T_WC,
         const RayCastOptions& options)
      : pass_(pass),
        options_(options),
        camera_{camera, T_WC},
        blocks_(FindRayBlocks(pass.volumes, camera_, pass.voxel_m, options.near_m, pass.contested)),
        tiles_(ListTiles(blocks_, camera)) {
    // Volumes whose lattice is the world's share their rays.
    for (const RayVolume& volume : pass.volumes) {
      const bool share = volume.lattice_is_world && world_ >= 0;
      if (!share) {
        if (volume.lattice_is_world) world_ = static_cast<int>(lattices_.size());
        lattices_.push_back(RaysIn(volume, camera_, pass.voxel_m));
      }
      lattice_of_.push_back(share ? world_ : static_cast<int>(lattices_.size()) - 1);
    }
    for (std::size_t i = 0; i < blocks_.size(); ++i) {
      id_of_block_.push_back(pass.volumes[blocks_[i].volume].id);
    }
    world_rays_ = RaysIn({}, camera_, 1.0);
    for (int k = 0; k < options.surfaces; ++k) {
      RaySurface& surface = surfaces_.emplace_back();
      surface.depth.create(camera.height, camera.width, CV_32FC1);
      surface.normal.create(camera.height, camera.width, CV_32FC3);
      surface.id.create(camera.height, camera.width, CV_16UC1);
      if (options.colour) surface.colour.create(camera.height, camera.width, CV_8UC3);
    }
  }

  std::vector<RaySurface> Run();

 private:
  class Tile;

  const RayPass& pass_;
  const RayCastOptions& options_;
  RayCamera camera_;
  RayBlocks blocks_;
  TileLists tiles_;
  int world_ = -1;
  std::vector<InstanceId> id_of_block_;
  std::vector<LatticeRays> lattices_;
  std::vector<int> lattice_of_;  // of each volume
  LatticeRays world_rays_;       // in metres
  std::vector<RaySurface> surfaces_;
};

// The work on one tile after another, and the room for it.
class Caster::Tile {
 public:
  explicit Tile(Caster& caster)
      : c_(caster),
        voxel_(static_cast<float>(caster.pass_.voxel_m)),
        rays_(caster.lattices_.size()),
        filled_(caster.lattices_.size(), 0),
        surfaces_(At(caster.options_.surfaces)) {
    from_.fill(static_cast<float>(c_.options_.near_m));
    if (c_.pass_.make_hidden) hidden_ = c_.pass_.make_hidden();
    if (c_.pass_.make_labels) labels_ = c_.pass_.make_labels();
  }

  void Cast(std::size_t number) {
    u_ = static_cast<int>(number) % c_.tiles_.columns * kTileSide;
    v_ = static_cast<int>(number) / c_.tiles_.columns * kTileSide;
    std::fill(filled_.begin(), filled_.end(), 0);
    const std::span<const std::uint32_t> list(
        c_.tiles_.block.data() + c_.tiles_.first[number],
        c_.tiles_.first[number + 1] - c_.tiles_.first[number]);
    if (c_.pass_.each_alone) {
      CastEachAlone(list);
    } else {
      for (std::size_t k = 0; k < surfaces_.size(); ++k) CastSurface(list, k);
    }
    for (std::size_t k = 0; k < surfaces_.size(); ++k) Write(k);
  }

 private:
  void Reset(TileHits& hits) const {
    hits.depth.fill(kInfinite);
    for (TileValues& component : hits.normal) component.fill(0);
    hits.block.fill(-1);
  }

  const TileRays& RaysOf(int lattice) {
    if (filled_[At(lattice)] == 0) {
      FillTileRays(c_.lattices_[At(lattice)], u_, v_, rays_[At(lattice)]);
      filled_[At(lattice)] = 1;
    }
    return rays_[At(lattice)];
  }

  float Through(std::uint32_t number, const TileValues& from, TileHits& hits) {
    const RayBlock& block = c_.blocks_[number];
    const int lattice = c_.lattice_of_[block.volume];
    return CastThroughBlock(block, static_cast<std::int32_t>(number), c_.lattices_[At(lattice)],
                            RaysOf(lattice), voxel_, from, hits);
  }

  InstanceId IdOf(const TileHits& hits, std::size_t i) const {
    return c_.id_of_block_[static_cast<std::size_t>(hits.block[i])];
  }

  // Pixel i's point at a depth, in the world, metres.
  Eigen::Vector3f PointAt(std::size_t i, float depth) const {
    const TileOrder& order = OrderOfTile();
    const auto u = static_cast<float>(u_ + order.x[i]);
    const auto v = static_cast<float>(v_ + order.y[i]);
    Eigen::Vector3f point;
    for (std::size_t a = 0; a < 3; ++a) {
      const LatticeRays& rays = c_.world_rays_;
      const float direction = (rays.at_pixel_0[a] + rays.per_row[a] * v) + rays.per_column[a] * u;
      point[static_cast<Eigen::Index>(a)] = static_cast<float>(rays.origin[a]) + depth * direction;
    }
    return point;
  }

  // The k-th surface is the first one in the map without the objects of those before.
  void CastSurface(std::span<const std::uint32_t> list, std::size_t k) {
    TileHits& hits = surfaces_[k];
    Reset(hits);
    if (k > 0) {
      for (std::size_t i = 0; i < kTilePixels; ++i) {
        if (surfaces_[k - 1].block[i] < 0) hits.depth[i] = 0;  // nothing in front: nothing behind
      }
    }
    Sweep(list, k, false, hits);
    if (!c_.pass_.contested) return;
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

  static void Copy(const TileHits& from, TileHits& to, std::size_t i) {
    to.depth[i] = from.depth[i];
    to.block[i] = from.block[i];
    for (std::size_t a = 0; a < 3; ++a) to.normal[a][i] = from.normal[a][i];
  }

  // Through the tile's blocks, nearest first. Pixels with a depth of 0 are left out.
  void Sweep(std::span<const std::uint32_t> list, std::size_t k, bool ask, TileHits& hits) {
    float farthest = Farthest(hits.depth);
    for (std::size_t l = 0; l < list.size(); ++l) {
      const std::uint32_t number = list[l];
      if (c_.blocks_.footprints[number].near_m >= farthest) break;
      if (l + 1 < list.size()) PrefetchBlock(c_.blocks_[list[l + 1]]);
      const TileValues* from = &from_;
      if (k > 0) {
        if (!FillFromLeft(c_.id_of_block_[number], k, hits)) continue;
        from = &from_left_;
      }
      farthest = ask && c_.blocks_[number].contested ? ThroughContested(number, *from, k, hits)
                                                     : Through(number, *from, hits);
    }
  }

  // Where the rays begin in volumes of an object: nowhere where it is in front. False where no ray
  // is left.
  bool FillFromLeft(InstanceId id, std::size_t k, const TileHits& hits) {
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
  bool AnyHidden(const TileHits& hits, const std::array<std::int32_t, kTilePixels>& asked,
                 std::size_t k) {
    queries_.clear();
    for (std::uint32_t i = 0; i < kTilePixels; ++i) {
      if (asked[i] < 0) continue;
      const auto number = static_cast<std::size_t>(hits.block[i]);
      if (!c_.blocks_[number].contested) continue;
      const Eigen::Vector3f normal(hits.normal[0][i], hits.normal[1][i], hits.normal[2][i]);
      queries_.push_back(
          {c_.id_of_block_[number], i, PointAt(i, hits.depth[i]) + 0.5F * voxel_ * normal, false});
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
  float ThroughContested(std::uint32_t number, const TileValues& from, std::size_t k,
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
          trial_from_[i] = trial_.depth[i] + past;
          trial_.depth[i] = hits.depth[i];
        } else {
          Copy(trial_, hits, i);
        }
      }
      if (again) Through(number, trial_from_, trial_);
    }
    return Farthest(hits.depth);
  }

  void CastEachAlone(std::span<const std::uint32_t> list) {
    for (TileHits& hits : surfaces_) Reset(hits);
    for (std::uint32_t volume = 0; volume < c_.pass_.volumes.size(); ++volume) {
      Reset(trial_);
      float farthest = kInfinite;
      bool any = false;
      for (const std::uint32_t number : list) {
        if (c_.blocks_[number].volume != volume) continue;
        if (c_.blocks_.footprints[number].near_m >= farthest) break;
        any = true;
        farthest = Through(number, from_, trial_);
      }
      if (any) Compete();
    }
  }

  // The hits of one volume take their places among those of the volumes before.
  void Compete() {
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

  // The mean over the corners with a colour, weighted by the trilinear coefficients.
  Colour ColourOf(std::size_t i, const TileHits& hits) {
    const std::uint32_t volume = c_.blocks_[static_cast<std::size_t>(hits.block[i])].volume;
    const int lattice = c_.lattice_of_[volume];
    const TileRays& rays = RaysOf(lattice);
    Eigen::Vector3d q;
    for (std::size_t a = 0; a < 3; ++a) {
      q[static_cast<Eigen::Index>(a)] =
          c_.lattices_[At(lattice)].origin[a] + double{hits.depth[i]} * rays.direction[a][i];
    }
    const Index3 base = FloorOf(q);
    const Eigen::Vector3d f = q - Eigen::Vector3d(base.x, base.y, base.z);
    const TsdfGrid& grid = *c_.pass_.volumes[volume].grid;
    const TsdfBlock* inner = grid.Find(BlockOf(base));
    double total = 0;
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (int corner = 0; corner < 8; ++corner) {
      const Index3 voxel = base + Index3{corner & 1, (corner >> 1) & 1, corner >> 2};
      const TsdfBlock* block = BlockOf(voxel) == BlockOf(base) ? inner : grid.Find(BlockOf(voxel));
      const std::size_t place = At(PlaceInBlock(voxel));
      if (block == nullptr || block->ColourCount(place) == 0) continue;
      double weight = 1;
      for (int a = 0; a < 3; ++a) weight *= ((corner >> a) & 1) != 0 ? f[a] : 1 - f[a];
      const FixedColour c = block->FixedColourAt(place);
      total += weight;
      sum += weight * Eigen::Vector3d(c[0], c[1], c[2]);
    }
    if (total <= 0) return {};
    const auto level = [&](double fixed) {
      return TsdfBlock::Level(static_cast<std::uint16_t>(fixed / total + 0.5));
    };
    return {level(sum[0]), level(sum[1]), level(sum[2])};
  }

  void Write(std::size_t k) {
    const TileOrder& order = OrderOfTile();
    const TileHits& hits = surfaces_[k];
    RaySurface& out = c_.surfaces_[k];
    const Intrinsics& camera = c_.camera_.intrinsics;
    const int columns = std::min(kTileSide, camera.width - u_);
    const int rows = std::min(kTileSide, camera.height - v_);
    for (int y = 0; y < rows; ++y) {
      float* depth = out.depth.ptr<float>(v_ + y) + u_;
      float* normal = out.normal.ptr<float>(v_ + y) + 3 * u_;
      std::uint16_t* id = out.id.ptr<std::uint16_t>(v_ + y) + u_;
      for (int x = 0; x < columns; x += kRun) {
        const std::size_t i = order.place[At(kTileSide * y + x)];
        if (x + kRun <= columns) {
          WritePixels<kRun>(hits, i, kRun, depth + x, normal + 3 * x, id + x);
        } else {
          WritePixels<0>(hits, i, columns - x, depth + x, normal + 3 * x, id + x);
        }
      }
    }
    if (labels_) WriteLabels(hits, columns, rows, out.id);
    if (c_.options_.colour) WriteColours(hits, columns, rows, out.colour);
  }

  // From the i-th pixel on, one after another in a row: kCount, or `count` where that is 0.
  template <int kCount>
  void WritePixels(const TileHits& hits, std::size_t i, int count, float* depth, float* normal,
                   std::uint16_t* id) const {
    const std::size_t end = i + At(kCount == 0 ? count : kCount);
    for (; i < end; ++i) {
      const bool hit = hits.block[i] >= 0;
      *depth++ = hit ? hits.depth[i] : 0;
      for (const TileValues& component : hits.normal) *normal++ = component[i];
      *id++ = hit ? IdOf(hits, i) : kNoInstance;
    }
  }

  void WriteLabels(const TileHits& hits, int columns, int rows, cv::Mat& ids) {
    // PointAt() and NearestVoxel(), an axis at a time. Where nothing was hit the voxel is not read.
    const TileOrder& order = OrderOfTile();
    const LatticeRays& rays = c_.world_rays_;
    const int first_u = u_;
    const int first_v = v_;
    const float voxel = voxel_;
    const float farthest = 0x1p25F * voxel;  // beyond all blocks, and the voxel's index is a number
    std::array<std::array<int, kTilePixels>, 3> along;
    for (std::size_t a = 0; a < 3; ++a) {
      const auto origin = static_cast<float>(rays.origin[a]);
      const float at_0 = rays.at_pixel_0[a];
      const float per_row = rays.per_row[a];
      const float per_column = rays.per_column[a];
      for (std::size_t i = 0; i < kTilePixels; ++i) {
        const auto u = static_cast<float>(first_u + order.x[i]);
        const auto v = static_cast<float>(first_v + order.y[i]);
        const float direction = (at_0 + per_row * v) + per_column * u;
        const float depth = std::min(hits.depth[i], farthest);
        along[a][i] = NearestAlong(origin + depth * direction, voxel);
      }
    }
    for (std::size_t i = 0; i < kTilePixels; ++i) {
      voxels_[i] = {along[0][i], along[1][i], along[2][i]};
    }
    labels_(voxels_, labelled_);
    for (int y = 0; y < rows; ++y) {
      std::uint16_t* out = ids.ptr<std::uint16_t>(v_ + y) + u_;
      for (int x = 0; x < columns; ++x) {
        const std::size_t i = order.place[At(kTileSide * y + x)];
        if (hits.block[i] >= 0) out[x] = labelled_[i];
      }
    }
  }

  void WriteColours(const TileHits& hits, int columns, int rows, cv::Mat& colours) {
    for (int y = 0; y < rows; ++y) {
      std::uint8_t* out = colours.ptr<std::uint8_t>(v_ + y) + 3 * u_;
      for (int x = 0; x < columns; ++x) {
        const std::size_t i = OrderOfTile().place[At(kTileSide * y + x)];
        const Colour colour = hits.block[i] >= 0 ? ColourOf(i, hits) : Colour{};
        for (const std::uint8_t level : colour) *out++ = level;
      }
    }
  }

  Caster& c_;
  float voxel_;
  int u_ = 0;  // first pixel
  int v_ = 0;
  std::vector<TileRays> rays_;  // by lattice, where filled
  std::vector<std::uint8_t> filled_;
  std::vector<TileHits> surfaces_;
  TileHits trial_;
  TileHits redone_;
  TileValues from_;
  TileValues from_left_;
  TileValues trial_from_;
  std::vector<InstanceId> without_;
  RayPass::Hidden hidden_;
  VoxelLabels labels_;
  std::array<Index3, kTilePixels> voxels_;  // by TileOrder
  std::array<InstanceId, kTilePixels> labelled_;
  std::vector<HiddenQuery> queries_;
};

std::vector<RaySurface> Caster::Run() {
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, tiles_.first.size() - 1, kTilesPerTask),
      [&](const tbb::blocked_range<std::size_t>& range) {
        Tile tile(*this);
        for (std::size_t i = range.begin(); i != range.end(); ++i) tile.Cast(i);
      },
      tbb::simple_partitioner());
  return std::move(surfaces_);
}

}  // namespace

std::vector<RaySurface> RunRayPass(const RayPass& pass, const Intrinsics& camera, const Pose& T_WC,
                                   const RayCastOptions& options) {
  return Caster(pass, camera, T_WC, options).Run();
}

}  // namespace tsdfpp
