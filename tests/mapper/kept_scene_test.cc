// The kept visible scene where little changes, so that only what is near is looked at again: it is
// the one made from scratch.
#include <gtest/gtest.h>

#include <map>

#include "mapper/block_surfaces.h"
#include "mapper/mesh/scene_parts.h"
#include "tests/mapper/every_method.h"
#include "tests/mapper/from_scratch.h"
#include "tests/mapper/visible_triangles.h"

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
TSDFPP_FOR_EVERY_VOXEL_METHOD(KeptScene);

TEST_P(KeptScene, FollowsSmallChanges) {
  int small = 0;
  for (std::uint64_t seed = 1; seed <= 8; ++seed) {
    Dice dice(seed);
    MapConfig config = FineConfig(seed % 2 == 1 ? 2 : 4);
    if (seed > 2) config.confidence_cap = 1;  // who is active changes often
    const auto map = MakeMap(GetParam(), config);
    Scene scene = TableWithToys();
    for (int i = 0; i < 3; ++i) SetPosesThenFuse(*map, RenderToys(scene, 2.0 * i, i));
    SceneMesher mesher;
    mesher.SceneMesh(*map);
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
      const MeshWork work = mesher.Update(*map);
      if (work.changed > 0 && 4 * work.changed < work.blocks) ++small;
      ASSERT_TRUE(SameAsFromScratch(*map, mesher)) << "seed " << seed << ", event " << event;
    }
    EXPECT_GT(map->SceneMesh().triangles.size(), 1000U);
  }
  EXPECT_GT(small, 10);
}

// The faces of one id, with the vertices that they use.
TriangleMesh FacesOf(const TriangleMesh& scene, InstanceId id) {
  std::map<std::uint32_t, std::uint32_t> renamed;
  for (std::size_t i = 0; i < scene.triangles.size(); ++i) {
    if (scene.face_ids[i] != id) continue;
    for (const std::uint32_t v : scene.triangles[i]) renamed[v] = 0;
  }
  TriangleMesh mesh;
  for (auto& [v, name] : renamed) {
    name = static_cast<std::uint32_t>(mesh.vertices.size());
    mesh.vertices.push_back(scene.vertices[v]);
    mesh.colours.push_back(scene.colours[v]);
  }
  for (std::size_t i = 0; i < scene.triangles.size(); ++i) {
    if (scene.face_ids[i] != id) continue;
    const auto& [a, b, c] = scene.triangles[i];
    mesh.triangles.push_back({renamed.at(a), renamed.at(b), renamed.at(c)});
  }
  return mesh;
}

// They are parted once and kept until something changes.
TEST(KeptFields, ObjectsAreTheFacesOfTheScene) {
  for (const Method method : VoxelMethods()) {
    SCOPED_TRACE(MethodName(method));
    const auto map = MakeMap(method, ToyConfig());
    const SurfacesInBlocks surfaces = map->block_surfaces()->Surfaces();
    if (!surfaces.field || surfaces.objects) continue;  // those have meshes of their own
    SceneMesher mesher;
    for (int i = 0; i < 3; ++i) {
      SetPosesThenFuse(*map, DriveFrame(i));
      mesher.Update(*map);
      const std::size_t before = mesher.Bytes();
      const TriangleMesh scene = mesher.SceneMesh(*map);
      int shown = 0;
      for (const InstanceId id : ToyIds()) {
        const TriangleMesh expected = FacesOf(scene, id);
        if (!expected.triangles.empty()) ++shown;
        EXPECT_TRUE(BytesOf(mesher.ObjectMesh(*map, id)) == BytesOf(expected)) << id;
      }
      EXPECT_GE(shown, 2);
      EXPECT_TRUE(mesher.ObjectMesh(*map, 9).vertices.empty());
      EXPECT_GT(mesher.Bytes(), before);
      const std::size_t kept = mesher.Bytes();
      EXPECT_FALSE(mesher.ObjectMesh(*map, kBackground).triangles.empty());
      EXPECT_EQ(mesher.Bytes(), kept);
    }
  }
}

// Where `tsdf++` lists another object first, triangles of objects whose values are as they were may
// become hidden or visible.
class KeptSceneOfLists : public ::testing::Test {
 protected:
  static MapConfig Config(double voxel_m) {
    MapConfig config = ToyConfig();
    config.voxel_m = voxel_m;
    return config;
  }
  explicit KeptSceneOfLists(double voxel_m = 0.5 * kToyVoxel_m)
      : map_(MakeMap(Method::kTsdfpp, Config(voxel_m))) {}

  void FuseAndMesh(int frames) {
    for (int i = 0; i < frames; ++i) SetPosesThenFuse(*map_, RenderToys(scene_, 0, i));
    mesher_.Update(*map_);
  }
  std::size_t HiddenOfTable() {
    const TriangleMesh visible = mesher_.SceneMesh(*map_);
    const auto shown = std::count(visible.face_ids.begin(), visible.face_ids.end(), kBackground);
    return map_->ObjectMesh(kBackground).triangles.size() - static_cast<std::size_t>(shown);
  }
  // That so little changed that the change is followed.
  void UpdateLittle() {
    const MeshWork work = mesher_.Update(*map_);
    ASSERT_GT(work.changed, 0U);
    ASSERT_LT(4 * work.changed, work.blocks);
    ASSERT_TRUE(SameAsFromScratch(*map_, mesher_));
  }

  Scene scene_ = TableOnly();
  std::unique_ptr<MapRepresentation> map_;
  SceneMesher mesher_;
};

TEST_F(KeptSceneOfLists, FollowsVotes) {
  constexpr int kSeenBefore = 3;
  FuseAndMesh(kSeenBefore);
  // The table's surface lies inside the brick, where both have values and the votes decide.
  const double above_m = 3 * map_->config().voxel_m;
  AddBrick(scene_, 0, {0, 0, kTableTop_m + above_m - 0.045});
  std::vector<std::size_t> hidden;
  for (int i = 0; i < 2 * kSeenBefore; ++i) {
    const Frame frame = RenderToys(scene_, 0, kSeenBefore + i);
    cv::Mat labels(frame.mask.size(), CV_16UC1, cv::Scalar(kNoInstance));
    labels.setTo(cv::Scalar(kBrick), frame.mask == kBrick);
    map_->SetObjectPose(kBrick, scene_.T_WO[kBrick]);
    map_->Fuse(frame, labels);
    ASSERT_NO_FATAL_FAILURE(UpdateLittle()) << "frame " << i;
    hidden.push_back(HiddenOfTable());
  }
  EXPECT_LT(hidden.front(), 10U);
  EXPECT_GT(hidden.back(), 50U);
}

class KeptSceneOfFineLists : public KeptSceneOfLists {
 protected:
  KeptSceneOfFineLists() : KeptSceneOfLists(0.25 * kToyVoxel_m) {}
};

TEST_F(KeptSceneOfFineLists, FollowsMoves) {
  AddBall(scene_, {0.12, -0.08, kTableTop_m + 0.055});
  FuseAndMesh(2);
  const Pose T_WO = scene_.T_WO[kBall];
  const std::size_t before = HiddenOfTable();
  map_->SetObjectPose(kBall, reference::MakePose(0, {0, 0, 1}, {-0.1, 0.1, kTableTop_m}));
  ASSERT_NO_FATAL_FAILURE(UpdateLittle());
  EXPECT_GT(HiddenOfTable(), before + 50);
  map_->SetObjectPose(kBall, T_WO);
  ASSERT_NO_FATAL_FAILURE(UpdateLittle());
  EXPECT_LT(HiddenOfTable(), before + 50);
}

// Far from where it was born, an object in its own lattice is hidden by what is there.
TEST(KeptSceneOfAnchored, HidesWhatMovedFarAway) {
  Scene scene = TableOnly();
  const auto map = MakeMap(Method::kTsdfppAnchored, ToyConfig());
  map->Fuse(RenderToys(scene, 0, 0), RenderToys(scene, 0, 0).mask);
  const Eigen::Vector3d birth(1.5, 0, 0);
  AddBall(scene, birth);
  const Frame frame =
      reference::Render(scene, reference::LookAt(birth + Eigen::Vector3d(0, 0.3, 0.4), birth), 1);
  map->SetObjectPose(kBall, scene.T_WO[kBall]);
  map->Fuse(frame, frame.mask);
  SceneMesher mesher;
  const auto visible = [&] {
    const TriangleMesh scene_mesh = mesher.SceneMesh(*map);
    return std::count(scene_mesh.face_ids.begin(), scene_mesh.face_ids.end(), kBall);
  };
  const auto all = visible();
  ASSERT_GT(all, 20);
  EXPECT_EQ(static_cast<std::size_t>(all), map->ObjectMesh(kBall).triangles.size());
  // Its upper side two voxels below the table's.
  map->SetObjectPose(
      kBall, reference::MakePose(0, {0, 0, 1}, {0, 0, kTableTop_m - 0.055 - 2 * kToyVoxel_m}));
  EXPECT_LT(visible(), all);
  EXPECT_EQ(mesher.SceneMesh(*map).triangles.size(), VisibleTriangles(*map).size());
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
      // One in ten reaches beyond all of the set.
      const int side = dice.Whole(10) == 0 ? 40 : 3;
      const BlockBox box{at, at + Index3{dice.Whole(side), dice.Whole(side), dice.Whole(side)},
                         false};
      bool meets = false;
      for (int z = box.low.z; z <= box.high.z; ++z) {
        for (int y = box.low.y; y <= box.high.y; ++y) {
          for (int x = box.low.x; x <= box.high.x; ++x) meets = meets || expected({x, y, z});
        }
      }
      ASSERT_EQ(set->Meets(box), meets);
    }
    std::vector<MeshPart*> parts;
    for (MeshPart* part : mesh.parts()) {
      if (expected(part->index)) parts.push_back(part);
    }
    ASSERT_EQ(PartsIn(*set, mesh), parts);
  }
  EXPECT_FALSE(BlockSet::Of({}, 1)->Holds({0, 0, 0}));
  EXPECT_TRUE(PartsIn(*BlockSet::Of({}, 1), mesh).empty());
  constexpr int kFar = 1000000;
  EXPECT_FALSE(
      BlockSet::Of({{{0, 0, 0}, {0, 0, 0}, false}, {{kFar, kFar, 0}, {kFar, kFar, 0}, false}}, 0))
      << "a terabyte of table";
}

}  // namespace
}  // namespace tsdfpp
