#include "bench/known_models.h"

#include <cmath>
#include <limits>
#include <set>
#include <vector>

#include "metrics/solid.h"
#include "metrics/surface_index.h"

namespace tsdfpp {
namespace {

constexpr std::uint8_t kWellKnown = std::numeric_limits<std::uint8_t>::max();  // observations

Index3 BlockAt(const Eigen::Vector3f& p, double block_m) {
  const Eigen::Vector3d at = (p.cast<double>() / block_m).array().floor();
  return ToIndex3(at.cast<int>());
}

// The blocks that the triangles' bounds meet when they are widened by `band_m`.
std::set<Index3> BlocksNear(const TriangleMesh& mesh, double block_m, double band_m) {
  const Eigen::Vector3f band = Eigen::Vector3f::Constant(static_cast<float>(band_m));
  std::set<Index3> blocks;
  for (const auto& [a, b, c] : mesh.triangles) {
    Eigen::AlignedBox3f bounds(mesh.vertices[a]);
    bounds.extend(mesh.vertices[b]).extend(mesh.vertices[c]);
    const Index3 low = BlockAt(bounds.min() - band, block_m);
    const Index3 high = BlockAt(bounds.max() + band, block_m);
    for (int z = low.z; z <= high.z; ++z) {
      for (int y = low.y; y <= high.y; ++y) {
        for (int x = low.x; x <= high.x; ++x) blocks.insert({x, y, z});
      }
    }
  }
  return blocks;
}

}  // namespace

TsdfGrid GridOfSolid(const TriangleMesh& mesh_O, double voxel_m, double band_voxels) {
  const SurfaceIndex surface(mesh_O);
  const Solid solid(mesh_O);
  TsdfGrid grid;
  std::vector<Eigen::Vector3f> points(kBlockVoxels);
  for (const Index3& index : BlocksNear(mesh_O, kBlockSide * voxel_m, band_voxels * voxel_m)) {
    for (int place = 0; place < kBlockVoxels; ++place) {
      const Index3 voxel = VoxelAt(index, place);
      points[static_cast<std::size_t>(place)] =
          (Eigen::Vector3d(voxel.x, voxel.y, voxel.z) * voxel_m).cast<float>();
    }
    const NearestSurface nearest = surface.Nearest(points);
    const std::vector<std::uint8_t> inside = solid.Contains(points);
    auto block = std::make_unique<TsdfBlock>();
    for (std::size_t i = 0; i < points.size(); ++i) {
      const float distance = nearest.distance_m[i];
      block->distance[i] = inside[i] != 0 ? -distance : distance;
      block->weight[i] = kWellKnown;
    }
    block->UpdateMasks(static_cast<float>(band_voxels * voxel_m));
    grid.Add(index, std::move(block));
  }
  return grid;
}

}  // namespace tsdfpp
