// The cubes of a block: the kernels of vectors and the plain ones find the same.
#include <gtest/gtest.h>

#include "mapper/volume/cube_masks.h"
#include "tests/mapper/kernel_twins.h"

namespace tsdfpp {
namespace {

TEST(CubeMasksTwins, TheSameCubes) {
  OnEveryInstructionSet([&] {
    Dice dice(25);
    for (int round = 0; round < 30; ++round) {
      std::array<BlockMask, 8> observed;
      std::array<BlockMask, 8> negative;
      UpperMasks upper_observed{};
      UpperMasks upper_negative{};
      const double density = dice.Uniform(0, 1);
      for (std::size_t i = 0; i < 8; ++i) {
        observed[i] = RandomMask(dice, 0.97);
        negative[i] = RandomMask(dice, density);
        for (std::size_t z = 0; z < kBlockSide; ++z) negative[i][z] &= observed[i][z];
        upper_observed[i] = &observed[i];
        upper_negative[i] = &negative[i];
      }
      const CubeMasks found = FindCubeMasks(upper_observed, upper_negative);
      const CubeMasks expected = plain::FindCubeMasks(upper_observed, upper_negative);
      ASSERT_EQ(found.complete, expected.complete);
      ASSERT_EQ(found.crossed, expected.crossed);
      const BlockMask few = RandomMask(dice, 0.02);
      upper_negative[static_cast<std::size_t>(dice.Whole(8))] = &few;
      ASSERT_EQ(CornersOfCubes(upper_negative), plain::CornersOfCubes(upper_negative));
      // The signs of a block that is mostly inside, or outside.
      for (std::size_t k = 0; k < 8; k += 2) {
        BlockMask now = negative[k + 1];
        for (std::size_t z = 0; z < kBlockSide; ++z) now[z] &= observed[k][z];
        ASSERT_EQ(ChangedSigns(observed[k], negative[k], observed[k], now),
                  plain::ChangedSigns(observed[k], negative[k], observed[k], now));
        ASSERT_EQ(ChangedSigns(observed[k], negative[k], observed[k + 1], negative[k + 1]),
                  plain::ChangedSigns(observed[k], negative[k], observed[k + 1], negative[k + 1]));
      }
    }
  });
}

}  // namespace
}  // namespace tsdfpp
