// Distances of solids in closed form.
#include "bench/known_models.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace tsdfpp {
namespace {

constexpr double kVoxel_m = 0.01;
constexpr double kBand_voxels = 4;
// Half precision has eleven bits, so it is off by less than this share; and single precision.
constexpr double kHalf = 1.0 / 2048;
constexpr double kSingle_m = 1e-7;

// A box about a corner that is no voxel.
const Eigen::AlignedBox3d kBox{Eigen::Vector3d(-0.053, -0.041, -0.017),
                               Eigen::Vector3d(0.062, 0.048, 0.071)};

TriangleMesh BoxMesh() {
  TriangleMesh mesh;
  for (int i = 0; i < 8; ++i) {
    const auto corner = static_cast<Eigen::AlignedBox3d::CornerType>(i);
    mesh.vertices.push_back(kBox.corner(corner).cast<float>());
  }
  mesh.triangles = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                    {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  return mesh;
}

double DistanceToBox(const Eigen::Vector3d& p) {
  const Eigen::Vector3d beyond = (kBox.min() - p).cwiseMax(p - kBox.max());
  return beyond.cwiseMax(0).norm() + std::min(beyond.maxCoeff(), 0.0);
}

TEST(KnownModels, DistancesOfABoxAreExact) {
  const TsdfGrid grid = GridOfSolid(BoxMesh(), kVoxel_m, kBand_voxels);
  ASSERT_FALSE(grid.empty());
  double worst = 0;
  for (const auto& entry : grid.entries()) {
    for (int place = 0; place < kBlockVoxels; ++place) {
      const Index3 v = VoxelAt(entry.index, place);
      const double expected = DistanceToBox(Eigen::Vector3d(v.x, v.y, v.z) * kVoxel_m);
      const double found = entry.block->distance[static_cast<std::size_t>(place)];
      worst = std::max(worst, (std::abs(found - expected) - kSingle_m) / std::abs(expected));
      EXPECT_GT(entry.block->weight[static_cast<std::size_t>(place)], 0);
    }
  }
  EXPECT_LT(worst, kHalf);
}

TEST(KnownModels, AllVoxelsNearTheSurfaceAreThere) {
  const TsdfGrid grid = GridOfSolid(BoxMesh(), kVoxel_m, kBand_voxels);
  const int reach = static_cast<int>(kBox.max().maxCoeff() / kVoxel_m + kBand_voxels) + 2;
  for (int z = -reach; z <= reach; ++z) {
    for (int y = -reach; y <= reach; ++y) {
      for (int x = -reach; x <= reach; ++x) {
        const double distance_m = DistanceToBox(Eigen::Vector3d(x, y, z) * kVoxel_m);
        if (std::abs(distance_m) > kBand_voxels * kVoxel_m) continue;
        ASSERT_NE(grid.Find(BlockOf({x, y, z})), nullptr) << x << " " << y << " " << z;
      }
    }
  }
}

}  // namespace
}  // namespace tsdfpp
