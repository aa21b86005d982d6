// Blocks that are left out of a frame's fusion would have taken nothing from it. What a frame has
// to say is asked of the reference, voxel by voxel, and of no kernel.
#include <gtest/gtest.h>

#include <algorithm>
#include <optional>
#include <set>

#include "mapper/volume/observation.h"
#include "tests/mapper/toy_scene.h"
#include "tests/reference/dense_voxel.h"

namespace tsdfpp {
namespace {

std::vector<Index3> BlocksOfBox() {
  std::vector<Index3> blocks;
  for (int z = -6; z <= 6; ++z) {
    for (int y = -8; y <= 8; ++y) {
      for (int x = -8; x <= 8; ++x) blocks.push_back({x, y, z});
    }
  }
  return blocks;
}

// What the frame says of each of the block's voxels; nothing where it is not observed, or lies
// behind the band.
std::vector<std::optional<reference::Seen>> Observations(const reference::View& view,
                                                         const Index3& block,
                                                         const MapConfig& config) {
  std::vector<std::optional<reference::Seen>> all;
  for (int place = 0; place < kBlockVoxels; ++place) {
    const Index3 v = VoxelAt(block, place);
    all.push_back(view.Look({v.x, v.y, v.z}));
    if (all.back() && all.back()->s < -config.back()) all.back().reset();
  }
  return all;
}

std::set<InstanceId> LabelsSeen(const reference::View& view, const Index3& block,
                                const MapConfig& config) {
  std::set<InstanceId> labels;
  for (const auto& seen : Observations(view, block, config)) {
    if (seen) labels.insert(seen->label);
  }
  return labels;
}

class PlanBlocksTest : public ::testing::TestWithParam<int> {};
INSTANTIATE_TEST_SUITE_P(Views, PlanBlocksTest, ::testing::Range(0, 6));

TEST_P(PlanBlocksTest, LeavesOutOnlyWhatTheFrameDoesNotSee) {
  Dice dice(static_cast<std::uint64_t>(GetParam()) + 3);
  const MapConfig config = ToyConfig(1 + GetParam() % 4);
  Frame frame = RenderToys(TableWithToys(), dice.Uniform(0, 6.28));
  frame.depth(cv::Rect(dice.Whole(60), dice.Whole(40), 20, 15)).setTo(0);
  frame.mask(cv::Rect(dice.Whole(60), dice.Whole(40), 20, 15)).setTo(kNoInstance);
  const FrameView view(frame, frame.mask);
  const CameraFromLattice T_CL(frame.T_WC, Pose::Identity(), true);
  const reference::View plain(frame, frame.mask, Pose::Identity(), config);
  const std::vector<Index3> blocks = BlocksOfBox();
  std::vector<std::set<InstanceId>> seen_in;
  for (const Index3& block : blocks) seen_in.push_back(LabelsSeen(plain, block, config));
  for (const InstanceId id : ToyIds()) {
    for (const bool of_any_label : {false, true}) {
      std::map<std::size_t, InstanceId> planned;
      for (const PlannedBlock& block :
           PlanBlocks(view, blocks.size(), config.voxel(), config.back(),
                      [&](std::size_t i) -> BlockCandidate {
                        return {blocks[i], &T_CL, id, of_any_label};
                      })) {
        EXPECT_TRUE(planned.emplace(block.number, block.label).second) << "twice";
      }
      EXPECT_GT(planned.size(), 4U);
      EXPECT_LT(planned.size(), blocks.size() / 2) << "nothing is left out";
      for (std::size_t i = 0; i < blocks.size(); ++i) {
        const std::set<InstanceId>& seen = seen_in[i];
        const auto plan = planned.find(i);
        if (plan == planned.end()) {
          EXPECT_FALSE(of_any_label ? !seen.empty() : seen.contains(id)) << "block " << i;
        } else if (plan->second != kNoInstance) {
          EXPECT_TRUE(seen.empty() || seen == std::set{plan->second}) << "block " << i;
        }
      }
    }
  }
}

// Of blocks that are all in view it is not asked again.
TEST_P(PlanBlocksTest, AllInViewIsSaidOfBlocksWithoutAVoxelOutside) {
  const MapConfig config = ToyConfig(1 + GetParam() % 4);
  const Frame frame = RenderToys(TableWithToys(), GetParam());
  const FrameView view(frame, frame.mask);
  const CameraFromLattice T_CL(frame.T_WC, Pose::Identity(), true);
  const std::vector<Index3> blocks = BlocksOfBox();
  const auto planned = PlanBlocks(view, blocks.size(), config.voxel(), config.back(),
                                  [&](std::size_t i) -> BlockCandidate {
                                    return {blocks[i], &T_CL, 1, true};
                                  });
  std::size_t inside = 0;
  std::size_t in_view = 0;
  for (const PlannedBlock& block : planned) {
    bool all = true;
    for (int i = 0; i < kBlockVoxels; ++i) {
      const Index3 v = VoxelAt(blocks[block.number], i);
      const Eigen::Vector3d p_C =
          frame.T_WC.inverse() * (Eigen::Vector3d(v.x, v.y, v.z) * config.voxel_m);
      const double u = frame.intrinsics.fx * p_C.x() / p_C.z() + frame.intrinsics.cx;
      const double at = frame.intrinsics.fy * p_C.y() / p_C.z() + frame.intrinsics.cy;
      all = all && p_C.z() > kNearest_m && u > 0 && u < view.width - 1 && at > 0 &&
            at < view.height - 1;
    }
    EXPECT_TRUE(all || !block.all_in_view) << "block " << block.number;
    inside += all ? 1 : 0;
    in_view += block.all_in_view ? 1 : 0;
  }
  EXPECT_GT(2 * in_view, inside) << "hardly any";
  EXPECT_LT(inside, planned.size()) << "none at the border";
}

// Far out single precision moves voxels by pixels: what is said to be in view is so for the kernel,
// which then reads those pixels unasked. Returns of how many blocks it is said.
std::size_t CheckAllInView(int parameter, int far) {
  const MapConfig config = ToyConfig(1 + parameter % 4);
  Frame frame = RenderToys(TableWithToys(), parameter);
  frame.depth.setTo(2.0);  // a pixel says something of each voxel
  const Index3 offset{far, parameter < 3 ? far : 0, -far};
  frame.T_WC.translation() +=
      Eigen::Vector3d(offset.x, offset.y, offset.z) * (kBlockSide * config.voxel_m);
  const FrameView view(frame, frame.mask);
  const CameraFromLattice T_CL(frame.T_WC, Pose::Identity(), true);
  std::vector<Index3> blocks = BlocksOfBox();
  for (Index3& block : blocks) {
    block = {block.x + offset.x, block.y + offset.y, block.z + offset.z};
  }
  constexpr float kBehind_m = 3;  // behind depth, for all blocks of the box
  std::size_t in_view = 0;
  for (PlannedBlock block : PlanBlocks(view, blocks.size(), config.voxel(), kBehind_m,
                                       [&](std::size_t i) -> BlockCandidate {
                                         return {blocks[i], &T_CL, 1, true};
                                       })) {
    if (!block.all_in_view) continue;
    ++in_view;
    block.all_in_view = false;  // so that the kernel asks
    BlockObservation seen;
    EXPECT_TRUE(ObserveVoxels(
        view.kernel, PlaceOf(T_CL, blocks[block.number], config.voxel(), block), kBehind_m, seen));
    EXPECT_EQ(std::count(seen.pixel.begin(), seen.pixel.end(), -1), 0) << "block " << block.number;
  }
  return in_view;
}

TEST_P(PlanBlocksTest, AllInViewHoldsForTheKernelFarOut) {
  EXPECT_GT(CheckAllInView(GetParam(), kFurthestBlock / 32), 0U) << "the test asks of nothing";
  // As far out as this nothing is sure to be in view.
  for (const int far : {kFurthestBlock / 4, kFurthestBlock - 16, -(kFurthestBlock - 16)}) {
    CheckAllInView(GetParam(), far);
  }
}

// What the plan tells the kernels of a block (that all of it is in view, from where on it is
// hidden) takes no observation away and adds none.
TEST_P(PlanBlocksTest, APlannedBlockIsObservedAsTheReferenceDoes) {
  Dice dice(static_cast<std::uint64_t>(GetParam()) + 11);
  const MapConfig config = ToyConfig(1 + GetParam() % 4);
  Frame frame = RenderToys(TableWithToys(), dice.Uniform(0, 6.28));
  frame.depth(cv::Rect(dice.Whole(60), dice.Whole(40), 20, 15)).setTo(0);
  frame.mask(cv::Rect(dice.Whole(60), dice.Whole(40), 20, 15)).setTo(kNoInstance);
  const FrameView view(frame, frame.mask);
  const CameraFromLattice T_CL(frame.T_WC, Pose::Identity(), true);
  const reference::View plain(frame, frame.mask, Pose::Identity(), config);
  const std::vector<Index3> blocks = BlocksOfBox();
  std::size_t observed = 0;
  for (const PlannedBlock& block : PlanBlocks(view, blocks.size(), config.voxel(), config.back(),
                                              [&](std::size_t i) -> BlockCandidate {
                                                return {blocks[i], &T_CL, 1, true};
                                              })) {
    const Index3& index = blocks[block.number];
    BlockObservation observation;
    const bool any = ObserveVoxels(view.kernel, PlaceOf(T_CL, index, config.voxel(), block),
                                   config.back(), observation);
    const auto expected = Observations(plain, index, config);
    for (std::size_t i = 0; i < expected.size(); ++i) {
      if (!expected[i]) {
        ASSERT_TRUE(!any || observation.pixel[i] == -1) << "block " << block.number << ", " << i;
        continue;
      }
      ASSERT_TRUE(any) << "block " << block.number << ", " << i;
      ASSERT_EQ(observation.pixel[i], expected[i]->pixel) << "block " << block.number << ", " << i;
      ASSERT_EQ(observation.distance[i], expected[i]->s) << "block " << block.number << ", " << i;
      ++observed;
    }
  }
  EXPECT_GT(observed, 1000U);
}

}  // namespace
}  // namespace tsdfpp
