// Rays through blocks: the kernels of vectors and the plain ones meet the same surfaces, to the
// bit.
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <memory>

#include "mapper/rays/ray_kernels.h"
#include "tests/mapper/kernel_twins.h"

namespace tsdfpp {
namespace {

constexpr float kVoxel_m = 0.02F;

bool SameBitsOfAll(const TileValues& a, const TileValues& b) {
  return std::equal(a.begin(), a.end(), b.begin(), SameBits);
}

// Crossed cubes by the signs of the corners, less some that are not observed.
void FindCrossed(Dice& dice, RayBlock& block) {
  block.cubes.low = {kBlockSide, kBlockSide, kBlockSide};
  block.cubes.high = {0, 0, 0};
  block.cubes.bits.fill(0);
  for (int i = 0; i < kBlockVoxels; ++i) {
    const Index3 v = VoxelAt({0, 0, 0}, i);
    int negative = 0;
    for (int k = 0; k < 8; ++k) {
      const int corner =
          kCorners * (kCorners * (v.z + (k >> 2)) + v.y + ((k >> 1) & 1)) + v.x + (k & 1);
      negative += block.distance[static_cast<std::size_t>(corner)] < 0 ? 1 : 0;
    }
    if (negative == 0 || negative == 8 || dice.Whole(20) == 0) continue;
    block.cubes.bits[static_cast<std::size_t>(i / 32)] |= 1U << static_cast<unsigned>(i % 32);
    const std::array<int, 3> place{v.x, v.y, v.z};
    for (std::size_t a = 0; a < 3; ++a) {
      block.cubes.low[a] = std::min(block.cubes.low[a], static_cast<std::uint8_t>(place[a]));
      block.cubes.high[a] = std::max(block.cubes.high[a], static_cast<std::uint8_t>(place[a] + 1));
    }
  }
}

// A plane, bent by noise, or noise alone.
std::unique_ptr<RayBlock> DrawRayBlock(Dice& dice) {
  auto block = std::make_unique<RayBlock>();
  block->index = {dice.Whole(5) - 2, dice.Whole(5) - 2, dice.Whole(5) - 2};
  const Eigen::Vector3d normal =
      Eigen::Vector3d(dice.Uniform(-1, 1), dice.Uniform(-1, 1), dice.Uniform(-1, 1)).normalized();
  const double noise = dice.Whole(3) == 0 ? 0 : dice.Uniform(0, 0.05);
  for (std::size_t i = 0; i < block->distance.size(); ++i) {
    const auto n = static_cast<int>(i);
    const Eigen::Vector3d p(n % kCorners - 4, n / kCorners % kCorners - 4,
                            n / (kCorners * kCorners) - 4);
    // As a block stores them; some are exactly 0.
    block->distance[i] = RoundToHalf(static_cast<float>(
        dice.Whole(30) == 0 ? 0 : kVoxel_m * normal.dot(p) + dice.Uniform(-1, 1) * noise));
  }
  FindCrossed(dice, *block);
  return block;
}

// A camera that looks at the block, in places along an axis, a face or a diagonal of the lattice.
LatticeRays DrawCamera(Dice& dice, const RayBlock& block, bool along_lattice) {
  const Eigen::Vector3d middle = 8 * Eigen::Vector3d(block.index.x, block.index.y, block.index.z) +
                                 Eigen::Vector3d::Constant(4);
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  Eigen::Vector3d back(0, 0, -20);
  if (!along_lattice) {
    const Eigen::Vector3d axis(dice.Uniform(-1, 1), dice.Uniform(-1, 1), dice.Uniform(-1, 1));
    R = Eigen::AngleAxisd(dice.Uniform(-3, 3), axis.normalized()).toRotationMatrix();
    back.z() = dice.Uniform(-25, -3);  // the nearest are inside the block
  } else if (dice.Whole(2) == 0) {
    back = Eigen::Vector3d(-16, -16, -16);
  }
  LatticeRays lattice;
  const Eigen::Vector3d origin = middle + R * back;
  // 16 pixels across some ten voxels at the block.
  const double per_pixel = along_lattice ? 1.0 / 32 : dice.Uniform(0.01, 0.06);
  const Eigen::Vector3d forward =
      along_lattice ? Eigen::Vector3d(-back / 20) : Eigen::Vector3d(R.col(2));
  for (int a = 0; a < 3; ++a) {
    const auto k = static_cast<std::size_t>(a);
    lattice.origin[k] = origin[a];
    lattice.per_column[k] = static_cast<float>(R(a, 0) * per_pixel / kVoxel_m);
    lattice.per_row[k] = static_cast<float>(R(a, 1) * per_pixel / kVoxel_m);
    lattice.at_pixel_0[k] =
        static_cast<float>((forward[a] - 8 * per_pixel * (R(a, 0) + R(a, 1))) / kVoxel_m);
    for (int c = 0; c < 3; ++c)
      lattice.R_WL[static_cast<std::size_t>(3 * a + c)] = static_cast<float>(R(c, a));
  }
  return lattice;
}

// What rays have met before: nothing, or something in front of the block, in it or behind it.
TileHits DrawHits(Dice& dice) {
  TileHits hits;
  for (std::size_t i = 0; i < kTilePixels; ++i) {
    hits.depth[i] = dice.Whole(3) > 0 ? std::numeric_limits<float>::infinity()
                                      : static_cast<float>(dice.Uniform(0, 0.6));
    if (dice.Whole(30) == 0) hits.depth[i] = 0;
    hits.block[i] = dice.Whole(2) - 1;
    for (TileValues& component : hits.normal) component[i] = static_cast<float>(dice.Whole(2));
  }
  return hits;
}

TEST(RayTwins, TheSameRaysAndCorners) {
  OnEveryInstructionSet([&] {
    Dice dice(31);
    for (int round = 0; round < 20; ++round) {
      const auto block = DrawRayBlock(dice);
      const LatticeRays lattice = DrawCamera(dice, *block, round % 2 == 0);
      TileRays found;
      TileRays expected;
      const int u = 16 * dice.Whole(3);
      const int v = 16 * dice.Whole(3);
      FillTileRays(lattice, u, v, found);
      plain::FillTileRays(lattice, u, v, expected);
      for (std::size_t a = 0; a < 3; ++a) {
        ASSERT_TRUE(SameBitsOfAll(found.direction[a], expected.direction[a]));
        ASSERT_TRUE(SameBitsOfAll(found.inverse[a], expected.inverse[a]));
      }
      std::array<TsdfBlock, 8> blocks;
      std::array<const Half*, 8> corners{};
      for (std::size_t i = 0; i < 8; ++i) {
        DrawBlock(dice, {0.08F, 0.08F, 50}, blocks[i]);
        corners[i] = blocks[i].distance.data();
      }
      RayBlock filled;
      RayBlock plain_filled;
      CopyCorners(corners, filled);
      plain::CopyCorners(corners, plain_filled);
      ASSERT_TRUE(std::equal(filled.distance.begin(), filled.distance.end(),
                             plain_filled.distance.begin(), SameBits));
    }
  });
}

TEST(RayTwins, TheSameSurfacesAreMet) {
  int met = 0;
  int kept = 0;
  OnEveryInstructionSet([&] {
    Dice dice(32);
    for (int round = 0; round < 120; ++round) {
      const auto block = DrawRayBlock(dice);
      const LatticeRays lattice = DrawCamera(dice, *block, round % 3 == 0);
      TileRays rays;
      plain::FillTileRays(lattice, 0, 0, rays);
      TileValues from;
      for (float& depth : from) {
        depth = dice.Whole(8) == 0
                    ? std::numeric_limits<float>::infinity()
                    : static_cast<float>(dice.Whole(2) == 0 ? 0 : dice.Uniform(0, 0.4));
      }
      TileHits found = DrawHits(dice);
      TileHits expected = found;
      const TileHits before = found;
      const float farthest = CastThroughBlock(*block, 7, lattice, rays, kVoxel_m, from, found);
      ASSERT_TRUE(SameBits(
          farthest, plain::CastThroughBlock(*block, 7, lattice, rays, kVoxel_m, from, expected)));
      ASSERT_EQ(found.block, expected.block) << round;
      ASSERT_TRUE(SameBitsOfAll(found.depth, expected.depth)) << round;
      for (std::size_t a = 0; a < 3; ++a) {
        ASSERT_TRUE(SameBitsOfAll(found.normal[a], expected.normal[a])) << round;
      }
      for (std::size_t i = 0; i < kTilePixels; ++i) {
        met += found.block[i] == 7 ? 1 : 0;
        kept += found.block[i] == before.block[i] ? 1 : 0;
      }
    }
  });
  EXPECT_GT(met, 3000);
  EXPECT_GT(kept, 3000);
}

}  // namespace
}  // namespace tsdfpp
