#include "mapper/rays/tile_image.h"

#include <algorithm>

#include "mapper/mesh/mesh_tools.h"
#include "mapper/volume/object_volume.h"

namespace tsdfpp {
namespace {

constexpr int kRun = 4;  // pixels of a row that TileOrder keeps together

std::size_t At(int i) { return static_cast<std::size_t>(i); }

}  // namespace

std::vector<RaySurface> MakeImages(const Intrinsics& camera, const RayCastOptions& options) {
  std::vector<RaySurface> surfaces;
  for (int k = 0; k < options.surfaces; ++k) {
    RaySurface& surface = surfaces.emplace_back();
    surface.depth.create(camera.height, camera.width, CV_32FC1);
    surface.normal.create(camera.height, camera.width, CV_32FC3);
    surface.id.create(camera.height, camera.width, CV_16UC1);
    if (options.colour) surface.colour.create(camera.height, camera.width, CV_8UC3);
  }
  return surfaces;
}

TileImage::TileImage(const RayScene& scene) : scene_(scene) {
  if (scene.pass.make_labels) labels_ = scene.pass.make_labels();
}

InstanceId TileImage::IdOf(const TileHits& hits, std::size_t i) const {
  return scene_.id_of_block[static_cast<std::size_t>(hits.block[i])];
}

void TileImage::Write(const TileHits& hits, TileRaysOf& rays, RaySurface& out) {
  rays_ = &rays;
  const TileOrder& order = OrderOfTile();
  const Intrinsics& camera = scene_.camera.intrinsics;
  const int columns = std::min(kTileSide, camera.width - rays_->u());
  const int rows = std::min(kTileSide, camera.height - rays_->v());
  for (int y = 0; y < rows; ++y) {
    float* depth = out.depth.ptr<float>(rays_->v() + y) + rays_->u();
    float* normal = out.normal.ptr<float>(rays_->v() + y) + 3 * rays_->u();
    std::uint16_t* id = out.id.ptr<std::uint16_t>(rays_->v() + y) + rays_->u();
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
  if (scene_.options.colour) WriteColours(hits, columns, rows, out.colour);
}

// From the i-th pixel on, one after another in a row: kCount, or `count` where that is 0.
template <int kCount>
void TileImage::WritePixels(const TileHits& hits, std::size_t i, int count, float* depth,
                            float* normal, std::uint16_t* id) const {
  const std::size_t end = i + At(kCount == 0 ? count : kCount);
  for (; i < end; ++i) {
    const bool hit = hits.block[i] >= 0;
    *depth++ = hit ? hits.depth[i] : 0;
    for (const TileValues& component : hits.normal) *normal++ = component[i];
    *id++ = hit ? IdOf(hits, i) : kNoInstance;
  }
}

void TileImage::WriteLabels(const TileHits& hits, int columns, int rows, cv::Mat& ids) {
  // PointAt() and NearestVoxel(), an axis at a time. Where nothing was hit the voxel is not read.
  const TileOrder& order = OrderOfTile();
  const LatticeRays& rays = scene_.world_rays;
  const int first_u = rays_->u();
  const int first_v = rays_->v();
  const auto voxel = static_cast<float>(scene_.pass.voxel_m);
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
    std::uint16_t* out = ids.ptr<std::uint16_t>(rays_->v() + y) + rays_->u();
    for (int x = 0; x < columns; ++x) {
      const std::size_t i = order.place[At(kTileSide * y + x)];
      if (hits.block[i] >= 0) out[x] = labelled_[i];
    }
  }
}

void TileImage::WriteColours(const TileHits& hits, int columns, int rows, cv::Mat& colours) {
  for (int y = 0; y < rows; ++y) {
    std::uint8_t* out = colours.ptr<std::uint8_t>(rays_->v() + y) + 3 * rays_->u();
    for (int x = 0; x < columns; ++x) {
      const std::size_t i = OrderOfTile().place[At(kTileSide * y + x)];
      const Colour colour = hits.block[i] >= 0 ? ColourOf(i, hits) : Colour{};
      for (const std::uint8_t level : colour) *out++ = level;
    }
  }
}

// The mean over the corners with a colour, weighted by the trilinear coefficients.
Colour TileImage::ColourOf(std::size_t i, const TileHits& hits) {
  const std::uint32_t volume = scene_.blocks[static_cast<std::size_t>(hits.block[i])].volume;
  const int lattice = scene_.lattice_of[volume];
  const TileRays& rays = rays_->In(lattice);
  Eigen::Vector3d q;
  for (std::size_t a = 0; a < 3; ++a) {
    q[static_cast<Eigen::Index>(a)] =
        scene_.lattices[At(lattice)].origin[a] + double{hits.depth[i]} * rays.direction[a][i];
  }
  const Index3 base = FloorOf(q);
  const Eigen::Vector3d f = q - Eigen::Vector3d(base.x, base.y, base.z);
  const TsdfGrid& grid = *scene_.pass.volumes[volume].grid;
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

}  // namespace tsdfpp
