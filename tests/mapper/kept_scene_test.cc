// The kept visible scene where little changes, so that only what is near is looked at again: it is
// the one made from scratch.
#include <gtest/gtest.h>

#include "mapper/scene_parts.h"
#include "tests/mapper/every_method.h"
#include "tests/mapper/from_scratch.h"

namespace tsdfpp {
namespace {

using reference::MakePose;
using reference::Scene;

// Half the toys' voxel, so that the table is many blocks.
MapConfig FineConfig(int layers) {
  MapConfig config = ToyConfig();
  config.voxel_m = 0.5 * kToyVoxel_m;
  config.layers = layers;
  return config;
}

// The frame's labels in a window, `as` in place of them where that is an id, and none elsewhere.
cv::Mat LabelsIn(const Frame& frame, const cv::Rect& window, InstanceId as) {
  cv::Mat labels(frame.mask.size(), CV_16UC1, cv::Scalar(kNoInstance));
  frame.mask(window).copyTo(labels(window));
  if (as != kNoInstance) labels(window).setTo(cv::Scalar(as), frame.mask(window) != kNoInstance);
  return labels;
}

class KeptScene : public EveryMethodTest {};
TSDFPP_FOR_EVERY_METHOD(KeptScene);

TEST_P(KeptScene, FollowsSmallChanges) {
  int small = 0;
  for (std::uint64_t seed = 1; seed <= 8; ++seed) {
    Dice dice(seed);
    MapConfig config = FineConfig(seed % 2 == 1 ? 2 : 4);
    if (seed > 2) config.confidence_cap = 1;  // who is active changes often
    const auto map = MakeMap(GetParam(), config);
    Scene scene = TableWithToys();
    for (int i = 0; i < 3; ++i) SetPosesThenFuse(*map, RenderToys(scene, 2.0 * i, i));
    map->SceneMesh();
    for (int event = 0; event < 24; ++event) {
      const auto id = static_cast<InstanceId>(1 + dice.Whole(3));
      const int what = dice.Whole(4);
      if (what <= 1) {
        scene.T_WO[id] = MakePose(dice.Uniform(-1, 1), {0.1, dice.Uniform(-0.2, 0.2), 1},
                                  {dice.Uniform(-0.2, 0.2), dice.Uniform(-0.2, 0.2),
                                   kTableTop_m + dice.Uniform(0.01, 0.06)});
        map->SetObjectPose(id, scene.T_WO[id]);
      }
      if (what >= 1) {
        // A part of the image alone; one time in three with labels that are wrong, so that votes
        // are lost.
        const Frame frame = RenderToys(scene, dice.Uniform(0, 6), event);
        const int side = frame.mask.rows / 4;
        const cv::Rect window(dice.Whole(frame.mask.cols - side),
                              dice.Whole(frame.mask.rows - side), side, side);
        map->Fuse(frame, LabelsIn(frame, window, dice.Whole(3) == 0 ? id : kNoInstance));
      }
      // Not after every event, so that changes add up.
      if (dice.Whole(3) == 0) continue;
      const MeshWork work = map->UpdateMeshes();
      if (work.changed > 0 && 4 * work.changed < work.blocks) ++small;
      ASSERT_TRUE(SameAsFromScratch(*map)) << "seed " << seed << ", event " << event;
    }
    EXPECT_GT(map->SceneMesh().triangles.size(), 1000U);
  }
  EXPECT_GT(small, 10);
}

TEST(BlockSet, HoldsTheBlocksOfTheBoxesAndThoseNear) {
  Dice dice(5);
  const auto some = [&] {
    return Index3{dice.Whole(20) - 10, dice.Whole(20) - 10, dice.Whole(20) - 10};
  };
  TsdfGrid grid;
  for (int i = 0; i < 500; ++i) grid.FindOrAdd(some());
  GridMesh mesh;
  mesh.Update(grid, 0.1F);
  for (int i = 0; i < 50; ++i) {
    std::vector<BlockBox> boxes(1 + static_cast<std::size_t>(dice.Whole(4)));
    for (BlockBox& box : boxes) {
      const Index3 low = some();
      box = {low, low + Index3{dice.Whole(3), dice.Whole(3), dice.Whole(3)}, false};
    }
    const int margin = i % 3;
    const auto set = BlockSet::Of(boxes, margin);
    ASSERT_TRUE(set);
    const auto expected = [&](const Index3& a) {
      return std::any_of(boxes.begin(), boxes.end(), [&](const BlockBox& box) {
        const auto [low, high, is_empty] = box;
        return a.x >= low.x - margin && a.x <= high.x + margin && a.y >= low.y - margin &&
               a.y <= high.y + margin && a.z >= low.z - margin && a.z <= high.z + margin;
      });
    };
    for (int k = 0; k < 200; ++k) {
      const Index3 at = some();
      ASSERT_EQ(set->Holds(at), expected(at));
      const BlockBox box{at, at + Index3{dice.Whole(2), dice.Whole(2), dice.Whole(2)}, false};
      bool meets = false;
      for (int corner = 0; corner < 8; ++corner) {
        meets = meets || expected({(corner & 1) != 0 ? box.high.x : box.low.x,
                                   (corner & 2) != 0 ? box.high.y : box.low.y,
                                   (corner & 4) != 0 ? box.high.z : box.low.z});
      }
      ASSERT_EQ(set->Meets(box), meets);
    }
    std::vector<MeshPart*> parts;
    for (MeshPart* part : mesh.parts()) {
      if (expected(part->index)) parts.push_back(part);
    }
    ASSERT_EQ(set->PartsOf(mesh), parts);
  }
  EXPECT_FALSE(BlockSet::Of({}, 1)->Holds({0, 0, 0}));
  EXPECT_TRUE(BlockSet::Of({}, 1)->PartsOf(mesh).empty());
  constexpr int kFar = 1000000;
  EXPECT_FALSE(
      BlockSet::Of({{{0, 0, 0}, {0, 0, 0}, false}, {{kFar, kFar, 0}, {kFar, kFar, 0}, false}}, 0))
      << "a terabyte of table";
}

}  // namespace
}  // namespace tsdfpp
