// Reading one lattice at the voxels of another: the kernels of vectors and the plain ones give the
// same bits.
#include <gtest/gtest.h>

#include <limits>
#include <memory>

#include "mapper/volume/pull_back.h"
#include "tests/mapper/kernel_twins.h"

namespace tsdfpp {
namespace {

constexpr double kVoxel_m = 1.0 / 64;  // so that some points are exactly half-way
constexpr BlockDraw kDraw{0.08F, 0.08F, 50, 0.95};

// A block pulled back into a lattice whose blocks are drawn; some are not there.
class Pulled {
 public:
  Pulled(Dice& dice, int round) {
    Pose T = Pose::Identity();
    if (round % 4 == 1) {  // by whole and half voxels
      T.translation() = Eigen::Vector3d(dice.Whole(9), dice.Whole(9), dice.Whole(9)) * kVoxel_m / 2;
    } else if (round % 4 == 2) {  // hardly less than that: fractions that round to 1
      T.translation() = Eigen::Vector3d(-1e-12, dice.Uniform(0, 1), -1e-10);
    } else if (round % 4 == 3) {
      const Eigen::Vector3d axis(dice.Uniform(-1, 1), dice.Uniform(-1, 1), dice.Uniform(-1, 1));
      T.rotate(Eigen::AngleAxisd(dice.Uniform(-3, 3), axis.normalized()));
      T.translation() = Eigen::Vector3d(dice.Uniform(-1, 1), dice.Uniform(-1, 1), 0.3);
    }
    rows = RowsOf(T);
    first = {8 * (dice.Whole(7) - 3), 8 * (dice.Whole(7) - 3), 8 * (dice.Whole(7) - 3)};
    plain::PullBackPoints(rows, kVoxel_m, first, points);
    const Index3 low = BlockOf(points.low);
    const Index3 high = BlockOf(points.high);
    for (int z = 0; z <= high.z - low.z; ++z) {
      for (int y = 0; y <= high.y - low.y; ++y) {
        for (int x = 0; x <= high.x - low.x; ++x) {
          if (dice.Whole(6) == 0) continue;
          owned_.push_back(std::make_unique<TsdfBlock>());
          DrawBlock(dice, kDraw, *owned_.back());
          blocks[static_cast<std::size_t>(9 * z + 3 * y + x)] = owned_.back().get();
        }
      }
    }
  }

  std::array<double, 12> rows{};
  Index3 first;
  PulledPoints points;
  PatchBlocks blocks{};

 private:
  std::vector<std::unique_ptr<TsdfBlock>> owned_;
};

template <typename Test>
void ForPulledBlocks(std::uint64_t seed, const Test& test) {
  OnEveryInstructionSet([&] {
    Dice dice(seed);
    for (int round = 0; round < 40; ++round) {
      const Pulled pulled(dice, round);
      test(pulled, dice);
      if (::testing::Test::HasFatalFailure()) return;
    }
  });
}

// Calls function(place) for each place of the patch up to `high`, less `margin`.
template <typename Function>
void ForEachPlace(const PulledPoints& points, int margin, const Function& function) {
  for (int z = 0; z <= points.high.z - points.low.z - margin; ++z) {
    for (int y = 0; y <= points.high.y - points.low.y - margin; ++y) {
      for (int x = 0; x <= points.high.x - points.low.x - margin; ++x) {
        function(static_cast<std::size_t>(kPatchSide * (kPatchSide * z + y) + x));
      }
    }
  }
}

bool BitAt(const PatchRows& rows, std::size_t place) {
  return (rows[place / kPatchSide] >> (place % kPatchSide) & 1U) != 0;
}

TEST(PullBackTwins, TheSamePoints) {
  int ones = 0;
  ForPulledBlocks(21, [&](const Pulled& pulled, Dice&) {
    PulledPoints found;
    PullBackPoints(pulled.rows, kVoxel_m, pulled.first, found);
    ASSERT_EQ(found.low, pulled.points.low);
    ASSERT_EQ(found.high, pulled.points.high);
    ASSERT_EQ(found.corner, pulled.points.corner);
    for (std::size_t a = 0; a < 3; ++a) {
      for (std::size_t i = 0; i < kBlockVoxels; ++i) {
        ASSERT_TRUE(SameBits(found.fraction[a][i], pulled.points.fraction[a][i]));
        ones += found.fraction[a][i] == 1 ? 1 : 0;
      }
    }
  });
  EXPECT_GT(ones, 0) << "no fraction was rounded up";
}

TEST(PullBackTwins, TheSameBitsAndCubes) {
  int crossed = 0;
  ForPulledBlocks(22, [&](const Pulled& pulled, Dice&) {
    const PulledPoints& points = pulled.points;
    PatchRows observed;
    PatchRows negative;
    for (const auto& [mask, rows] :
         {std::pair{&TsdfBlock::observed, &observed}, std::pair{&TsdfBlock::negative, &negative}}) {
      PatchRows expected;
      plain::PatchBits(pulled.blocks, points, mask, expected);
      PatchBits(pulled.blocks, points, mask, *rows);
      ForEachPlace(points, 0, [&, &rows = *rows](std::size_t place) {
        ASSERT_EQ(BitAt(rows, place), BitAt(expected, place)) << place;
      });
    }
    PatchCubes cubes;
    PatchCubes expected;
    PatchCubesOf(observed, negative, cubes);
    plain::PatchCubesOf(observed, negative, expected);
    ForEachPlace(points, 1, [&](std::size_t place) {
      ASSERT_EQ(BitAt(cubes.all_observed, place), BitAt(expected.all_observed, place)) << place;
      ASSERT_EQ(BitAt(cubes.any_negative, place), BitAt(expected.any_negative, place)) << place;
      ASSERT_EQ(BitAt(cubes.crossed, place), BitAt(expected.crossed, place)) << place;
      crossed += BitAt(cubes.crossed, place) ? 1 : 0;
    });
    ASSERT_EQ(MarkedAt(cubes.all_observed, points), plain::MarkedAt(cubes.all_observed, points));
    ASSERT_EQ(MarkedNearest(observed, points), plain::MarkedNearest(observed, points));
    ASSERT_EQ(InMarkedCube(cubes.crossed, points), plain::InMarkedCube(cubes.crossed, points));
  });
  EXPECT_GT(crossed, 1000);
}

TEST(PullBackTwins, TheSameValues) {
  int numbers = 0;
  ForPulledBlocks(23, [&](const Pulled& pulled, Dice& dice) {
    for (const PatchField field :
         {PatchField::kDistance, PatchField::kWeight, PatchField::kColourCount, PatchField::kRed,
          PatchField::kGreen, PatchField::kBlue}) {
      PatchValues found;
      PatchValues expected;
      PatchValuesOf(pulled.blocks, pulled.points, field, found);
      plain::PatchValuesOf(pulled.blocks, pulled.points, field, expected);
      ForEachPlace(pulled.points, 0, [&](std::size_t place) {
        ASSERT_TRUE(SameBits(found[place], expected[place])) << place;
      });
      const BlockMask wanted = RandomMask(dice, 0.7);
      const auto expect_same = [&](const auto& interpolate, const auto& plainly) {
        std::array<float, kBlockVoxels> at_points;
        std::array<float, kBlockVoxels> plain_at_points;
        interpolate(expected, pulled.points, wanted, at_points.data());
        plainly(expected, pulled.points, wanted, plain_at_points.data());
        for (int i = 0; i < kBlockVoxels; ++i) {
          if (!Bit(wanted, i)) continue;
          const auto k = static_cast<std::size_t>(i);
          ASSERT_TRUE(SameBits(at_points[k], plain_at_points[k]))
              << i << ": " << at_points[k] << ", " << plain_at_points[k];
          numbers += std::isnan(at_points[k]) ? 0 : 1;
        }
      };
      expect_same(InterpolateCounted, plain::InterpolateCounted);
      expect_same(InterpolateAll, plain::InterpolateAll);
      expect_same(InterpolateObserved, plain::InterpolateObserved);
    }
  });
  EXPECT_GT(numbers, 100000);
}

TEST(PullBackTwins, TheSameBlockIsPut) {
  int coloured = 0;
  ForPulledBlocks(24, [&](const Pulled& pulled, Dice& dice) {
    std::array<float, kBlockVoxels> distance;
    std::array<float, kBlockVoxels> weight;
    for (std::size_t i = 0; i < kBlockVoxels; ++i) {
      distance[i] = dice.Whole(9) == 0 ? std::numeric_limits<float>::quiet_NaN()
                                       : RandomDistance(dice, kDraw.front, kDraw.back);
      weight[i] = static_cast<float>(dice.Uniform(0, 255.4));
    }
    const BlockMask in_crossed = RandomMask(dice, 0.3);
    const BlockMask any = RandomMask(dice, 0.7);
    const BlockMask covered = Covered(any, in_crossed, distance.data(), kDraw.back);
    ASSERT_EQ(covered, plain::Covered(any, in_crossed, distance.data(), kDraw.back));

    PatchRows observed;
    plain::PatchBits(pulled.blocks, pulled.points, &TsdfBlock::observed, observed);
    const BlockMask wanted = plain::MarkedNearest(observed, pulled.points);
    PatchValues count;
    plain::PatchValuesOf(pulled.blocks, pulled.points, PatchField::kColourCount, count);
    std::array<PatchValues, 3> channels;
    plain::PatchValuesOf(pulled.blocks, pulled.points, PatchField::kRed, channels[0]);
    plain::PatchValuesOf(pulled.blocks, pulled.points, PatchField::kGreen, channels[1]);
    plain::PatchValuesOf(pulled.blocks, pulled.points, PatchField::kBlue, channels[2]);
    std::array<float, kBlockVoxels> counts;
    plain::InterpolateObserved(count, pulled.points, wanted, counts.data());
    for (float& d : distance) d = std::isnan(d) ? 0.0F : d;
    TsdfBlock found;
    TsdfBlock expected;
    PutValues(wanted, distance.data(), weight.data(), found);
    PutColours(channels, count, pulled.points, wanted, counts.data(), found);
    plain::PutValues(wanted, distance.data(), weight.data(), expected);
    plain::PutColours(channels, count, pulled.points, wanted, counts.data(), expected);
    ASSERT_TRUE(SameBlocks(found, expected));
    for (std::size_t i = 0; i < kBlockVoxels; ++i) coloured += found.ColourCount(i) > 0 ? 1 : 0;
  });
  EXPECT_GT(coloured, 5000);
}

}  // namespace
}  // namespace tsdfpp
