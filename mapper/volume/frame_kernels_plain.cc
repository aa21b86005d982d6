// Tiles pixel by pixel, and blocks along rays point by point (docs/map.md, "Allocation").
#include <algorithm>
#include <cmath>

#include "mapper/volume/block_grid.h"
#include "mapper/volume/frame_kernels.h"
#include "mapper/volume/fusion_kernels.h"

namespace tsdfpp::plain {
namespace {

Tile TileAt(const KernelFrame& frame, int left, int top) {
  const auto width = static_cast<int>(frame.width);
  const auto height = static_cast<int>(frame.height);
  Tile tile;
  for (int v = top; v < std::min(top + kTile_px, height); ++v) {
    for (int u = left; u < std::min(left + kTile_px, width); ++u) {
      const std::ptrdiff_t pixel = static_cast<std::ptrdiff_t>(v) * width + u;
      tile.least_label = std::min(tile.least_label, frame.label[pixel]);
      tile.greatest_label = std::max(tile.greatest_label, frame.label[pixel]);
      const float depth = frame.depth[pixel];
      if (!IsValidDepth(depth)) {
        tile.has_invalid = true;
        continue;
      }
      tile.nearest = std::min(tile.nearest, depth);
      tile.farthest = std::max(tile.farthest, depth);
    }
  }
  return tile;
}

// One ray in a lattice.
struct Ray {
  std::array<double, 3> direction{};  // voxels per metre of range
  double range = 0;                   // of the surface point, metres
};

Ray RayThrough(const CameraInLattice& camera, double x, double y, double depth) {
  const double length = std::sqrt(x * x + (y * y + 1.0));
  const double e_x = x / length;
  const double e_y = y / length;
  const double e_z = 1.0 / length;
  Ray ray;
  ray.range = depth * length;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto& row = camera.R_LC[axis];
    ray.direction[axis] = ((row[0] * e_x + row[1] * e_y) + row[2] * e_z) * camera.inverse_voxel;
  }
  return ray;
}

// The block of the voxel nearest to the ray's point at this range.
Index3 BlockAt(const CameraInLattice& camera, const Ray& ray, double range) {
  std::array<int, 3> voxel{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double point = camera.origin[axis] + ray.direction[axis] * range;
    voxel[axis] = static_cast<int>(std::floor(point + 0.5));
  }
  return BlockOf({voxel[0], voxel[1], voxel[2]});
}

}  // namespace

void SummariseTiles(const KernelFrame& frame, int row, Tile* tiles) {
  for (int left = 0; left < static_cast<int>(frame.width); left += kTile_px) {
    *tiles++ = TileAt(frame, left, row * kTile_px);
  }
}

std::size_t BlocksAtPoints(const CameraInLattice& camera, const RayPoints& where,
                           const RayBatch& rays, std::uint64_t* keys) {
  std::size_t count = 0;
  for (std::size_t r = 0; r < rays.count; ++r) {
    const Ray ray = RayThrough(camera, rays.x[r], rays.y[r], rays.depth[r]);
    const double first = ray.range - where.front;
    const double last = ray.range + where.back;
    for (std::size_t i = 0; i < where.points; ++i) {
      const double range = std::min(first + where.step * static_cast<double>(i), last);
      if (range >= 0) keys[count++] = PackIndex(BlockAt(camera, ray, range));
    }
  }
  return count;
}

}  // namespace tsdfpp::plain
