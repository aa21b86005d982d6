// Distances of solids in closed form.
#include "bench/known_models.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/metrics/test_scenes.h"
#include "tests/reference/sdf_registration_reference.h"

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

TriangleMesh BoxMesh() { return testing::Box(kBox.min().cast<float>(), kBox.max().cast<float>()); }

double DistanceToBox(const Eigen::Vector3d& p) {
  return reference::BoxDistance(kBox.sizes() / 2)(p - kBox.center());
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
