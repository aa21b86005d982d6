// Blocks that are left out of a frame's fusion would have taken nothing from it.
#include <gtest/gtest.h>

#include <limits>
#include <set>

#include "mapper/observation.h"
#include "tests/mapper/toy_scene.h"

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

// What a block's voxels see: labels of pixels that are not behind the band.
std::set<InstanceId> LabelsSeen(const FrameView& view, const CameraFromLattice& T_CL,
                                const Index3& block, const MapConfig& config) {
  BlockObservation observation;
  std::set<InstanceId> labels;
  if (!ObserveVoxels(view.kernel,
                     PlaceOf(T_CL, block, config.voxel(), std::numeric_limits<float>::infinity()),
                     config.back(), observation)) {
    return labels;
  }
  for (const std::int32_t pixel : observation.pixel) {
    if (pixel >= 0) labels.insert(view.kernel.label[pixel]);
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
  const std::vector<Index3> blocks = BlocksOfBox();
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
        const std::set<InstanceId> seen = LabelsSeen(view, T_CL, blocks[i], config);
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

}  // namespace
}  // namespace tsdfpp
