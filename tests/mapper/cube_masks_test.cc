// The cubes of a block and their corners, found voxel by voxel, with every instruction set.
#include "mapper/volume/cube_masks.h"

#include <gtest/gtest.h>
#include <hwy/highway.h>
#include <hwy/targets.h>

#include "tests/mapper/toy_scene.h"

namespace tsdfpp {
namespace {

// Voxels of 27 blocks, with the middle one's first voxel at (0, 0, 0).
class Voxels {
 public:
  explicit Voxels(std::array<BlockMask, 27>& masks) : masks_(&masks) {}

  bool At(const Index3& v) const { return Bit(BlockAt(BlockOf(v)), PlaceInBlock(v)); }
  void Set(const Index3& v) { SetBit(BlockAt(BlockOf(v)), PlaceInBlock(v)); }
  BlockMask& BlockAt(const Index3& block) const {
    return (*masks_)[static_cast<std::size_t>(9 * (block.z + 1) + 3 * (block.y + 1) + block.x + 1)];
  }

 private:
  std::array<BlockMask, 27>* masks_;
};

Index3 Step(int i) { return {i & 1, (i >> 1) & 1, i >> 2}; }
Index3 Back(int i) { return {-(i & 1), -((i >> 1) & 1), -(i >> 2)}; }

class CubeMasksTest : public ::testing::Test {
 protected:
  // Of all densities, for a cube is rarely complete and rarely of one sign.
  void Draw(Dice& dice) {
    observed_masks_ = {};
    negative_masks_ = {};
    const double observed = 1 - dice.Uniform(0, 0.1);
    const double negative = dice.Uniform(0, 1) < 0.5 ? dice.Uniform(0, 0.02) : dice.Uniform(0, 1);
    for (int z = -8; z < 16; ++z) {
      for (int y = -8; y < 16; ++y) {
        for (int x = -8; x < 16; ++x) {
          if (dice.Uniform(0, 1) > observed) continue;
          observed_.Set({x, y, z});
          if (dice.Uniform(0, 1) < negative) negative_.Set({x, y, z});
        }
      }
    }
  }
  bool IsComplete(const Index3& cube) const {
    for (int i = 0; i < 8; ++i) {
      if (!observed_.At(cube + Step(i))) return false;
    }
    return true;
  }
  bool IsCrossed(const Index3& cube) const {
    int negative = 0;
    for (int i = 0; i < 8; ++i) negative += negative_.At(cube + Step(i)) ? 1 : 0;
    return IsComplete(cube) && negative > 0 && negative < 8;
  }
  UpperMasks Upper(const Voxels& of, const Index3& block) const {
    UpperMasks masks{};
    for (int i = 0; i < 8; ++i) masks[static_cast<std::size_t>(i)] = &of.BlockAt(block + Step(i));
    return masks;
  }

  std::array<BlockMask, 27> observed_masks_{};
  std::array<BlockMask, 27> negative_masks_{};
  Voxels observed_{observed_masks_};
  Voxels negative_{negative_masks_};
};

TEST_F(CubeMasksTest, CubesAndTheirCornersAreThoseFoundVoxelByVoxel) {
  int corners = 0;
  for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) {
    hwy::SetSupportedTargetsForTest(target);
    Dice dice(7);
    for (int round = 0; round < 20; ++round) {
      Draw(dice);
      std::array<BlockMask, 8> crossed;
      LowerMasks lower{};
      for (int i = 0; i < 8; ++i) {
        const CubeMasks cubes = FindCubeMasks(Upper(observed_, Back(i)), Upper(negative_, Back(i)));
        for (int place = 0; place < kBlockVoxels; ++place) {
          const Index3 cube = VoxelAt(Back(i), place);
          ASSERT_EQ(Bit(cubes.complete, place), IsComplete(cube));
          ASSERT_EQ(Bit(cubes.crossed, place), IsCrossed(cube));
        }
        const auto k = static_cast<std::size_t>(i);
        crossed[k] = cubes.crossed;
        lower[k] = &crossed[k];
      }
      const BlockMask found = CornersOfCubes(lower);
      for (int place = 0; place < kBlockVoxels; ++place) {
        bool is_corner = false;
        for (int i = 0; i < 8; ++i) {
          is_corner = is_corner || IsCrossed(VoxelAt({0, 0, 0}, place) + Back(i));
        }
        ASSERT_EQ(Bit(found, place), is_corner);
        corners += is_corner ? 1 : 0;
      }
    }
    hwy::SetSupportedTargetsForTest(0);
  }
  EXPECT_GT(corners, 1000);
}

TEST_F(CubeMasksTest, SignsThatChangeMatterWhereBothMayMeet) {
  int left_out = 0;
  for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) {
    hwy::SetSupportedTargetsForTest(target);
    Dice dice(8);
    for (int round = 0; round < 40; ++round) {
      Draw(dice);
      const BlockMask old_observed = observed_.BlockAt({0, 0, 0});
      const BlockMask old_negative = negative_.BlockAt({0, 0, 0});
      Draw(dice);
      const BlockMask now_observed = observed_.BlockAt({0, 0, 0});
      const BlockMask now_negative = negative_.BlockAt({0, 0, 0});
      const BlockMask found = ChangedSigns(old_observed, old_negative, now_observed, now_negative);
      for (int place = 0; place < kBlockVoxels; ++place) {
        const bool differs = Bit(old_observed, place) != Bit(now_observed, place) ||
                             Bit(old_negative, place) != Bit(now_negative, place);
        bool inside = false;
        bool outside = false;
        bool is_rim = false;
        const Index3 at = VoxelAt({0, 0, 0}, place);
        for (int i = 0; i < 27; ++i) {
          const Index3 v = at + Index3{i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1};
          if (BlockOf(v) != Index3{0, 0, 0}) {
            is_rim = true;
            continue;
          }
          const int near = PlaceInBlock(v);
          inside = inside || Bit(old_negative, near) || Bit(now_negative, near);
          outside = outside || (Bit(old_observed, near) && !Bit(old_negative, near)) ||
                    (Bit(now_observed, near) && !Bit(now_negative, near));
        }
        ASSERT_EQ(Bit(found, place), differs && (is_rim || (inside && outside)));
        left_out += differs && !Bit(found, place) ? 1 : 0;
      }
    }
    hwy::SetSupportedTargetsForTest(0);
  }
  EXPECT_GT(left_out, 100);
}

}  // namespace
}  // namespace tsdfpp
