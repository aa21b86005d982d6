// Observation and fusion: the kernels of vectors and the plain ones change a block to the same
// bytes, whatever it holds and however much of it is in view.
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <vector>

#include "mapper/volume/frame_kernels.h"
#include "mapper/volume/fusion_kernels.h"
#include "mapper/volume/value_masks.h"
#include "tests/mapper/kernel_twins.h"

namespace tsdfpp {
namespace {

// Sums of 1 m and these are exact.
constexpr float kVoxel_m = 0x1.4p-6F;  // 1.95 cm
constexpr float kFront_m = 4 * kVoxel_m;
constexpr float kBack_m = 4 * kVoxel_m;
constexpr int kWidth = 72;
constexpr int kHeight = 51;

// What a frame's labels are.
enum class Shown { kOne, kNone, kMany };

// A tilted plane with noise and holes, and patches of labels.
struct TwinFrame {
  std::vector<float> depth;
  std::vector<std::uint16_t> label;
  std::vector<std::uint8_t> colour;
  std::vector<float> facing;
  float farthest = 0;
  KernelFrame kernel;

  TwinFrame(Dice& dice, Shown shown, bool with_holes)
      : depth(kWidth * kHeight),
        label(kWidth * kHeight),
        colour(3 * kWidth * kHeight),
        facing(kWidth * kHeight, 1) {
    const double middle = dice.Uniform(0.4, 0.9);
    const double slope = dice.Uniform(-0.004, 0.004);
    const double noise = dice.Whole(2) == 0 ? 0 : 0.04;
    const std::array<std::uint16_t, 4> labels{0, 1, 2, kNoInstance};
    std::array<std::uint16_t, 100> patches{};
    for (auto& patch : patches) patch = labels[static_cast<std::size_t>(dice.Whole(4))];
    for (int v = 0; v < kHeight; ++v) {
      for (int u = 0; u < kWidth; ++u) {
        const auto i = static_cast<std::size_t>(kWidth * v + u);
        const bool hole = with_holes && dice.Whole(10) == 0;
        depth[i] = hole
                       ? -std::numeric_limits<float>::infinity()
                       : static_cast<float>(middle + slope * (u - v) + dice.Uniform(-1, 1) * noise);
        farthest = std::max(farthest, depth[i]);
        label[i] = shown == Shown::kOne    ? std::uint16_t{1}
                   : shown == Shown::kNone ? kNoInstance
                                           : patches[static_cast<std::size_t>(v / 6 * 10 + u / 8)];
      }
    }
    for (auto& level : colour) level = static_cast<std::uint8_t>(dice.Whole(256));
    kernel = {depth.data(), label.data(), colour.data(), kWidth, kHeight, {60, 61, 35.2F, 24.7F}};
    if (dice.Whole(2) == 0) {
      for (std::size_t i = 0; i < facing.size(); ++i) {
        if (label[i] != kBackground) facing[i] = static_cast<float>(dice.Uniform(0.1, 1));
      }
      kernel.facing = facing.data();
    }
    // Or so that lattices along the camera's axes meet the borders of pixels.
    if (dice.Whole(3) == 0) kernel.intrinsics = {60, 60, 35.5F, 24.5F};
  }

  void SetDepth(float depth_m) {
    std::fill(depth.begin(), depth.end(), depth_m);
    farthest = depth_m;
  }
};

// A block somewhere around the surface, in part out of view, or behind the camera.
struct TwinPlace {
  std::array<float, 12> T_CL{};
  BlockPlace place;

  explicit TwinPlace(Dice& dice) {
    const Eigen::Vector3d axis(dice.Uniform(-1, 1), dice.Uniform(-1, 1), dice.Uniform(-1, 1));
    Pose T = Pose::Identity();
    if (dice.Whole(3) > 0) {
      T.rotate(Eigen::AngleAxisd(dice.Uniform(-0.5, 0.5), axis.normalized()));
      T.translation() = Eigen::Vector3d(dice.Uniform(-0.1, 0.1), dice.Uniform(-0.1, 0.1), 0);
    }
    for (int i = 0; i < 12; ++i) {
      T_CL[static_cast<std::size_t>(i)] = static_cast<float>(T.matrix()(i / 4, i % 4));
    }
    place.T_CL = T_CL.data();
    place.voxel = kVoxel_m;
    place.first = {8 * (dice.Whole(5) - 2), 8 * (dice.Whole(5) - 2), 8 * (dice.Whole(8) - 1)};
  }

  // All voxels at one point before the camera, at which s is the depth less 1 m, exactly.
  void MeetAtOneMetre() {
    T_CL = {};
    T_CL.back() = 1;
  }

  // What a caller may know of the block, where it is so.
  void Know(const TwinFrame& frame) {
    place.behind_m = frame.farthest + kBack_m;
    Dice dice(1);
    const TwinFrame whole(dice, Shown::kOne, false);
    BlockObservation seen;
    if (!plain::ObserveVoxels(whole.kernel, place, 100, seen)) return;
    place.all_in_view =
        std::all_of(seen.pixel.begin(), seen.pixel.end(), [](int pixel) { return pixel >= 0; });
  }
};

TEST(FusionTwins, ObserveTheSame) {
  int observed = 0;
  int in_part = 0;
  int wholly_in_view = 0;
  OnEveryInstructionSet([&] {
    Dice dice(11);
    for (int round = 0; round < 150; ++round) {
      const TwinFrame frame(dice, round % 10 == 0 ? Shown::kNone : Shown::kMany, round % 3 > 0);
      TwinPlace at(dice);
      BlockObservation expected;
      const bool any = plain::ObserveVoxels(frame.kernel, at.place, kBack_m, expected);
      if (dice.Whole(2) == 0) at.Know(frame);
      BlockObservation found;
      ASSERT_EQ(ObserveVoxels(frame.kernel, at.place, kBack_m, found), any) << round;
      wholly_in_view += at.place.all_in_view ? 1 : 0;
      if (!any) continue;  // then nobody reads it
      int count = 0;
      for (std::size_t i = 0; i < kBlockVoxels; ++i) {
        ASSERT_EQ(found.pixel[i], expected.pixel[i]) << round << ", voxel " << i;
        if (expected.pixel[i] < 0) continue;
        ASSERT_TRUE(SameBits(found.distance[i], expected.distance[i])) << round << ", voxel " << i;
        ++count;
      }
      observed += count;
      in_part += count < kBlockVoxels ? 1 : 0;
    }
  });
  EXPECT_GT(observed, 3000);
  EXPECT_GT(in_part, 20);
  EXPECT_GT(wholly_in_view, 3);
}

// How often what the rules speak of came up.
struct Seen {
  int fused = 0;    // voxels in band
  int cleared = 0;  // blocks
  int coloured = 0;
  int settled = 0;  // blocks in which something was seen and nothing changed
  int votes = 0;    // blocks in which a label changed
  int known = 0;    // blocks of one label
};

struct VoteArrays {
  std::array<std::uint16_t, kBlockVoxels> id{};
  std::array<std::uint16_t, kBlockVoxels> confidence{};
  LabelVotes votes;

  VoteArrays(Dice& dice, int cap) {
    for (std::size_t i = 0; i < kBlockVoxels; ++i) {
      const int label = dice.Whole(4);
      id[i] = label == 3 ? kNoInstance : static_cast<std::uint16_t>(label);
      confidence[i] = static_cast<std::uint16_t>(label == 3 ? 0 : 1 + dice.Whole(cap));
    }
    votes.cap = cap;
    if (dice.Whole(2) == 0) votes.band = 2 * kVoxel_m;
    if (dice.Whole(2) == 0) votes.guard = kVoxel_m;
  }
  VoteArrays(const VoteArrays& other) = default;
  VoteArrays& operator=(const VoteArrays&) = delete;
  LabelVotes* Get() {
    votes.id = id.data();
    votes.confidence = confidence.data();
    return &votes;
  }
};

FusionRule DrawRule(Dice& dice, int weight_cap) {
  FusionRule rule;
  rule.id = 1;
  rule.contradiction = dice.Whole(3) > 0;
  rule.front = kFront_m;
  rule.back = kBack_m;
  const bool whole_band = dice.Whole(4) == 0;
  rule.colour_band = whole_band ? kFront_m : 2 * kVoxel_m;
  rule.first_colour_band = whole_band ? kFront_m : 3 * kVoxel_m;
  rule.weight_cap = static_cast<float>(weight_cap);
  return rule;
}

void ExpectTheSameFusion(Dice& dice, int round, bool with_votes, Seen& seen) {
  const std::array<int, 4> caps{1, 7, 50, 255};
  const int weight_cap = caps[static_cast<std::size_t>(dice.Whole(4))];
  const Shown shown = round % 5 == 0 ? Shown::kOne : round % 11 == 0 ? Shown::kNone : Shown::kMany;
  TwinFrame frame(dice, shown, round % 3 > 0);
  TwinPlace at(dice);
  FusionRule rule = DrawRule(dice, weight_cap);
  if (round % 7 == 0) {
    // Where one rule ends and the next one begins.
    const std::array<float, 9> limits{0,
                                      rule.front,
                                      -rule.back,
                                      rule.colour_band,
                                      -rule.colour_band,
                                      rule.first_colour_band,
                                      kVoxel_m,
                                      -0.5F * kVoxel_m,
                                      2 * kVoxel_m};
    at.MeetAtOneMetre();
    frame.SetDepth(1 + limits[static_cast<std::size_t>(dice.Whole(9))]);
  }
  VoteArrays votes(dice, 1 + dice.Whole(10));
  VoteArrays plain_votes(votes);
  TsdfBlock block;
  DrawBlock(dice, {kFront_m, kBack_m, weight_cap, dice.Uniform(0.3, 1.2)}, block);
  if (dice.Whole(4) == 0) {  // free space, known to be at its cap throughout
    block.weight.fill(static_cast<std::uint8_t>(weight_cap));
    block.distance.fill(kFront_m);
    block.UpdateMasks(kBack_m);
    block.full.fill(~0ULL);
  }
  TsdfBlock plain_block = block;
  const TsdfBlock before = block;
  const TsdfBlock next;

  const FusionResult expected = plain::FuseVoxels(
      frame.kernel, at.place, rule, plain_block, nullptr, with_votes ? plain_votes.Get() : nullptr);
  if (dice.Whole(2) == 0) {
    at.Know(frame);
    rule.one_label = shown == Shown::kOne;
  }
  const FusionResult found =
      FuseVoxels(frame.kernel, at.place, rule, block, dice.Whole(2) == 0 ? &next : nullptr,
                 with_votes ? votes.Get() : nullptr);
  ASSERT_TRUE(SameBlocks(block, plain_block)) << round;
  ASSERT_EQ(found.changed, expected.changed) << round;
  ASSERT_EQ(found.in_band, expected.in_band) << round;
  ASSERT_EQ(found.changed_signs, expected.changed_signs) << round;
  ASSERT_EQ(found.band_changed, expected.band_changed) << round;
  ASSERT_EQ(votes.id, plain_votes.id) << round;
  ASSERT_EQ(votes.confidence, plain_votes.confidence) << round;
  ASSERT_EQ(votes.votes.any_label_changed, plain_votes.votes.any_label_changed) << round;

  BlockObservation observation;
  const bool any = plain::ObserveVoxels(frame.kernel, at.place, kBack_m, observation);
  if (!found.changed) {
    ASSERT_TRUE(SameBlocks(block, before)) << round;
  }
  seen.settled += any && !found.changed ? 1 : 0;
  for (int i = 0; i < kBlockVoxels; ++i) {
    const auto k = static_cast<std::size_t>(i);
    seen.fused += Bit(found.in_band, i) ? 1 : 0;
    seen.cleared += Bit(before.observed, i) && !Bit(block.observed, i) ? 1 : 0;
    seen.coloured += before.ColourCount(k) != block.ColourCount(k) ? 1 : 0;
  }
  seen.votes += votes.votes.any_label_changed ? 1 : 0;
  seen.known += rule.one_label ? 1 : 0;
}

TEST(FusionTwins, FuseTheSame) {
  Seen seen;
  OnEveryInstructionSet([&] {
    Dice dice(12);
    for (int round = 0; round < 250; ++round) {
      ExpectTheSameFusion(dice, round, false, seen);
      if (::testing::Test::HasFatalFailure()) return;
    }
  });
  EXPECT_GT(seen.fused, 3000);
  EXPECT_GT(seen.cleared, 300);
  EXPECT_GT(seen.coloured, 1000);
  EXPECT_GT(seen.settled, 3);
  EXPECT_GT(seen.known, 3);
}

TEST(FusionTwins, FuseAndVoteTheSame) {
  Seen seen;
  OnEveryInstructionSet([&] {
    Dice dice(13);
    for (int round = 0; round < 250; ++round) {
      ExpectTheSameFusion(dice, round, true, seen);
      if (::testing::Test::HasFatalFailure()) return;
    }
  });
  EXPECT_GT(seen.fused, 3000);
  EXPECT_GT(seen.coloured, 1000);
  EXPECT_GT(seen.votes, 20);
}

TEST(FusionTwins, SummariseTheSameTiles) {
  OnEveryInstructionSet([&] {
    Dice dice(14);
    for (int round = 0; round < 20; ++round) {
      const TwinFrame frame(dice, Shown::kMany, round % 2 == 0);
      for (int row = 0; row * kTile_px < kHeight; ++row) {
        std::array<Tile, kWidth / kTile_px + 1> found;
        std::array<Tile, kWidth / kTile_px + 1> expected;
        SummariseTiles(frame.kernel, row, found.data());
        plain::SummariseTiles(frame.kernel, row, expected.data());
        for (std::size_t i = 0; i < found.size(); ++i) {
          ASSERT_TRUE(SameBits(found[i].nearest, expected[i].nearest));
          ASSERT_TRUE(SameBits(found[i].farthest, expected[i].farthest));
          ASSERT_EQ(found[i].has_invalid, expected[i].has_invalid);
          ASSERT_EQ(found[i].least_label, expected[i].least_label);
          ASSERT_EQ(found[i].greatest_label, expected[i].greatest_label);
        }
      }
    }
  });
}

std::vector<std::uint64_t> Sorted(std::vector<std::uint64_t> keys, std::size_t count) {
  keys.resize(count);
  std::sort(keys.begin(), keys.end());
  keys.erase(std::unique(keys.begin(), keys.end()), keys.end());
  return keys;
}

// Vectors leave out some of the keys that they gave already; which they are does not matter.
TEST(FusionTwins, FindTheSameBlocksAlongRays) {
  std::size_t found_keys = 0;
  OnEveryInstructionSet([&] {
    Dice dice(15);
    for (int round = 0; round < 100; ++round) {
      const TwinPlace at(dice);
      CameraInLattice camera;
      camera.inverse_voxel = 1 / double{kVoxel_m};
      for (std::size_t r = 0; r < 3; ++r) {
        for (std::size_t c = 0; c < 3; ++c) camera.R_LC[r][c] = at.T_CL[4 * r + c];
        camera.origin[r] = dice.Uniform(-300, 300);
      }
      const RayPoints where{kFront_m, kBack_m, 2 * kVoxel_m, 5};
      RayBatch rays;
      rays.count = static_cast<std::size_t>(1 + dice.Whole(kRaysAtOnce));
      for (std::size_t i = 0; i < rays.count; ++i) {
        rays.x[i] = dice.Uniform(-0.6, 0.6);
        rays.y[i] = dice.Uniform(-0.4, 0.4);
        rays.depth[i] = dice.Uniform(0.01, 2);  // also less than the band in front
      }
      std::vector<std::uint64_t> keys(kRaysAtOnce * where.points + kKeysPerStep);
      std::vector<std::uint64_t> of_plain(keys);
      const std::size_t plain_count = plain::BlocksAtPoints(camera, where, rays, of_plain.data());
      const std::size_t count = BlocksAtPoints(camera, where, rays, keys.data());
      ASSERT_EQ(Sorted(keys, count), Sorted(of_plain, plain_count)) << round;
      found_keys += Sorted(keys, count).size();
    }
  });
  EXPECT_GT(found_keys, 1000U);
}

TEST(FusionTwins, DeriveTheSameMasks) {
  Dice dice(16);
  for (int round = 0; round < 100; ++round) {
    TsdfBlock block;
    DrawBlock(dice, {kFront_m, kBack_m, 50, dice.Uniform(0, 1.2)}, block);
    const ValueMasks found = MasksOfValues(block, kBack_m);
    const ValueMasks expected = plain::MasksOfValues(block, kBack_m);
    ASSERT_EQ(found.observed, expected.observed);
    ASSERT_EQ(found.negative, expected.negative);
    ASSERT_EQ(found.band, expected.band);
  }
}

}  // namespace
}  // namespace tsdfpp
