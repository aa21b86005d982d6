// Votes and lists of the global map volume: the kernels of vectors and the plain ones change them
// to the same bits.
#include <gtest/gtest.h>

#include <limits>

#include "mapper/index/index_kernels.h"
#include "tests/mapper/kernel_twins.h"

namespace tsdfpp {
namespace {

TEST(IndexTwins, TheSameVotesAndLists) {
  OnEveryInstructionSet([&] {
    Dice dice(26);
    for (int round = 0; round < 30; ++round) {
      const InstanceId id = round % 3 == 0 ? InstanceId{0xFFFE} : InstanceId{2};
      const int cap = 1 + dice.Whole(255);
      const BlockMask marked = RandomMask(dice, dice.Uniform(0, 1.2));
      std::array<InstanceId, kBlockVoxels> active{};
      std::array<std::uint8_t, kBlockVoxels> confidence{};
      for (std::size_t i = 0; i < kBlockVoxels; ++i) {
        active[i] = dice.Whole(3) > 0 ? id : dice.Whole(2) == 0 ? kNoInstance : InstanceId{1};
        confidence[i] = static_cast<std::uint8_t>(dice.Whole(cap + 1));
      }
      auto plain_confidence = confidence;
      const VotesCounted found = VoteForActive(marked, id, cap, active.data(), confidence.data());
      const VotesCounted expected =
          plain::VoteForActive(marked, id, cap, active.data(), plain_confidence.data());
      ASSERT_EQ(found.others, expected.others);
      ASSERT_EQ(found.saturated, expected.saturated);
      ASSERT_EQ(confidence, plain_confidence);

      auto plain_active = active;
      ListAlone(marked, id, active.data());
      plain::ListAlone(marked, id, plain_active.data());
      ASSERT_EQ(active, plain_active);

      constexpr int kMostLayers = 4;
      const int layers = 1 + dice.Whole(kMostLayers);
      std::array<float, kMostLayers * kBlockVoxels> near;
      std::array<InstanceId, kMostLayers * kBlockVoxels> ids;
      near.fill(std::numeric_limits<float>::infinity());
      ids.fill(kNoInstance);
      auto plain_near = near;
      auto plain_ids = ids;
      for (int o = 0; o < 6; ++o) {
        std::array<float, kBlockVoxels> distance{};
        // Few, so that some are equal.
        for (float& d : distance) d = 0.01F * static_cast<float>(dice.Whole(4) - 2);
        const BlockMask covered = RandomMask(dice, 0.7);
        const auto object = static_cast<InstanceId>(o);
        InsertByDistance(covered, distance.data(), object, {layers, near.data(), ids.data()});
        plain::InsertByDistance(covered, distance.data(), object,
                                {layers, plain_near.data(), plain_ids.data()});
      }
      ASSERT_EQ(near, plain_near);
      ASSERT_EQ(ids, plain_ids);
    }
  });
}

}  // namespace
}  // namespace tsdfpp
