// What must hold of the maps whatever their values are: lists, copies, poses, threads, removals.
#include <gtest/gtest.h>
#include <hwy/targets.h>
#include <tbb/global_control.h>

#include <iostream>
#include <set>

#include "mapper/voxel_inspection.h"
#include "tests/mapper/compare_maps.h"
#include "tests/mapper/map_snapshot.h"
#include "tests/mapper/mesh_checks.h"
#include "tests/mapper/methods_of_tests.h"
#include "tests/mapper/toy_scene.h"

namespace tsdfpp {
namespace {

using reference::MakePose;
using reference::Scene;

void SetPosesAndFuse(MapRepresentation& map, const Frame& frame) {
  for (const auto& [id, T_WO] : frame.T_WO) map.SetObjectPose(id, T_WO);
  map.Fuse(frame, frame.mask);
}

// The brick drives in a curve towards the ball; the camera follows. `moved` is told every frame.
template <typename Moved>
void Drive(MapRepresentation& map, int frames, Moved&& moved) {
  Scene scene = TableWithToys();
  for (int i = 0; i < frames; ++i) {
    scene.T_WO[kBrick] = MakePose(0.3 + 0.2 * i, Eigen::Vector3d::UnitZ(),
                                  {-0.14 + 0.05 * i, 0.03 - 0.02 * i, kTableTop_m + 0.045});
    SetPosesAndFuse(map, RenderToys(scene, 0.2 + 0.15 * i, i));
    moved();
  }
}
void Drive(MapRepresentation& map, int frames) {
  Drive(map, frames, [] {});
}

std::unique_ptr<MapRepresentation> MappedToys(Method method, const MapConfig& config, int frames) {
  auto map = MakeMap(method, config);
  for (int i = 0; i < frames; ++i) {
    SetPosesAndFuse(*map, RenderToys(TableWithToys(), 0.1 + 0.4 * i, i));
  }
  return map;
}

class EveryMethod : public ::testing::TestWithParam<Method> {};
TSDFPP_FOR_EVERY_METHOD(EveryMethod);
class EveryVoxelMethod : public ::testing::TestWithParam<Method> {};
TSDFPP_FOR_EVERY_VOXEL_METHOD(EveryVoxelMethod);

TEST_P(EveryVoxelMethod, ListsHoldNoObjectTwiceAndNoneTooMany) {
  const auto layers = static_cast<std::size_t>(LayersOf(GetParam(), ToyConfig()));
  const auto map = MakeMap(GetParam(), ToyConfig());
  Drive(*map, 5, [&] {
    for (const auto& v : VoxelsOf(*map).ListedVoxels()) {
      const auto list = VoxelsOf(*map).ListAt(v);
      std::set<InstanceId> ids;
      for (const Listing& entry : list) ids.insert(entry.id);
      ASSERT_EQ(ids.size(), list.size()) << Text(v) << Text(list);
      ASSERT_LE(list.size(), layers) << Text(v) << Text(list);
      ASSERT_FALSE(list.empty()) << Text(v);
    }
  });
}

TEST_P(EveryMethod, ACopyIsIndependent) {
  const auto map = MappedToys(GetParam(), ToyConfig(), 2);
  const std::string before = SnapshotOf(*map, ToyIds());
  const auto copy = map->Clone();
  EXPECT_TRUE(SnapshotOf(*copy, ToyIds()) == before);

  const auto without = map->Clone();
  without->Remove(kBrick);
  without->SetObjectPose(kBall, MakePose(0.5, Eigen::Vector3d::UnitZ(), {0.1, 0, 0.1}));
  without->Fuse(RenderToys(TableOnly(), 1), RenderToys(TableOnly(), 1).mask);
  EXPECT_FALSE(SnapshotOf(*without, ToyIds()) == before);
  EXPECT_TRUE(SnapshotOf(*map, ToyIds()) == before) << "the original changed with its copy";

  const std::string changed = SnapshotOf(*without, ToyIds());
  map->Remove(kTray);
  SetPosesAndFuse(*map, RenderToys(TableWithToys(), 2));
  EXPECT_TRUE(SnapshotOf(*without, ToyIds()) == changed) << "the copy changed with its original";
  EXPECT_TRUE(SnapshotOf(*copy, ToyIds()) == before) << "the copy changed with its original";
}

TEST_P(EveryMethod, ObjectsAreListedInOrderAndLeaveWhenRemoved) {
  const auto map = MappedToys(GetParam(), ToyConfig(), 2);
  EXPECT_EQ(map->Objects(), ToyIds());
  map->Remove(kBall);
  EXPECT_EQ(map->Objects(), (std::vector<InstanceId>{kBackground, kBrick, kTray}));
  EXPECT_TRUE(map->ObjectMesh(kBall).triangles.empty());
  if (map->inspection() != nullptr) {
    for (const auto& v : VoxelsOf(*map).ListedVoxels()) {
      for (const Listing& entry : VoxelsOf(*map).ListAt(v)) ASSERT_NE(entry.id, kBall) << Text(v);
    }
  }
  // Once more, and one that never was there.
  const std::string before = SnapshotOf(*map, ToyIds());
  map->Remove(kBall);
  map->Remove(17);
  EXPECT_TRUE(SnapshotOf(*map, ToyIds()) == before);
}

TEST_P(EveryMethod, ThreadsDoNotChangeABit) {
  std::string bytes;
  for (const std::size_t threads : {1U, 2U, 4U}) {
    const tbb::global_control control(tbb::global_control::max_allowed_parallelism, threads);
    const auto map = MakeMap(GetParam(), ToyConfig());
    Drive(*map, 3);
    map->Remove(kTray);
    const std::string now = SnapshotOf(*map, ToyIds());
    EXPECT_GT(now.size(), 100000U);
    if (threads == 1) bytes = now;
    EXPECT_TRUE(now == bytes) << threads << " threads";
  }
}

TEST_P(EveryMethod, InstructionSetsDoNotChangeABit) {
  std::string bytes;
  for (std::int64_t left = hwy::SupportedTargets(); left != 0; left &= left - 1) {
    const std::int64_t target = left & -left;
    hwy::SetSupportedTargetsForTest(target);
    ASSERT_EQ(hwy::SupportedTargets(), target);
    const auto map = MakeMap(GetParam(), ToyConfig());
    Drive(*map, 3);
    map->Remove(kTray);
    const std::string now = SnapshotOf(*map, ToyIds());
    hwy::SetSupportedTargetsForTest(0);
    EXPECT_GT(now.size(), 100000U);
    if (bytes.empty()) bytes = now;
    EXPECT_TRUE(now == bytes) << hwy::TargetName(target);
  }
}

TEST_P(EveryMethod, AnUnchangedPoseMovesNothing) {
  const auto map = MappedToys(GetParam(), ToyConfig(), 2);
  const std::string before = SnapshotOf(*map, ToyIds());
  for (const auto& [id, T_WO] : TableWithToys().T_WO) {
    map->SetObjectPose(id, T_WO);
    EXPECT_EQ(map->ObjectLattice(id).matrix(), Pose::Identity().matrix());
  }
  EXPECT_TRUE(SnapshotOf(*map, ToyIds()) == before);
}

TEST_P(EveryVoxelMethod, MemoryCountsBlocks) {
  const auto map = MakeMap(GetParam(), ToyConfig());
  EXPECT_EQ(map->Memory().blocks, 0U);
  Drive(*map, 1);
  const MapMemory memory = map->Memory();
  std::set<VoxelKey> blocks;
  for (const auto& v : VoxelsOf(*map).ObservedVoxels(kBackground)) {
    blocks.insert({v.x() >> 3, v.y() >> 3, v.z() >> 3});
  }
  EXPECT_GE(memory.blocks, blocks.size());
  EXPECT_GE(memory.bytes, memory.blocks * 512 * sizeof(std::uint16_t));
}

TEST_P(EveryMethod, AnEmptyMapAndFramesWithoutDepthHoldNothing) {
  const auto map = MakeMap(GetParam(), ToyConfig());
  Frame nothing = RenderToys(TableWithToys(), 0.3);
  nothing.depth.setTo(0);
  for (int i = 0; i < 3; ++i) SetPosesAndFuse(*map, nothing);
  EXPECT_TRUE(map->Objects().empty());
  EXPECT_EQ(map->Memory().blocks, 0U);
  EXPECT_TRUE(map->SceneMesh().triangles.empty());
  EXPECT_TRUE(map->ObjectMesh(kBrick).triangles.empty());
}

// With one place for an inactive object, three toys over the table still leave the table listed.
TEST(TsdfppProperties, TheBackgroundIsNeverDropped) {
  const auto map = MappedToys(Method::kTsdfpp, ToyConfig(), 2);
  std::vector<Eigen::Vector3i> table;
  for (const auto& v : VoxelsOf(*map).ListedVoxels()) {
    for (const Listing& entry : VoxelsOf(*map).ListAt(v)) {
      if (entry.id == kBackground) table.push_back(v);
    }
  }
  ASSERT_GT(table.size(), 1000U);
  const Eigen::Vector3d place(0.05, 0.05, kTableTop_m);  // halfway in the table
  std::size_t overflowed = 0;
  for (const InstanceId id : {kBrick, kBall, kTray}) {
    std::map<VoxelKey, std::size_t> lengths;
    for (const auto& v : table) lengths[{v.x(), v.y(), v.z()}] = VoxelsOf(*map).ListAt(v).size();
    map->SetObjectPose(id, MakePose(0.4 * id, Eigen::Vector3d::UnitZ(), place));
    for (const auto& v : table) {
      const auto list = VoxelsOf(*map).ListAt(v);
      const bool listed = std::any_of(list.begin(), list.end(),
                                      [](const Listing& e) { return e.id == kBackground; });
      ASSERT_TRUE(listed) << Text(v) << Text(list);
      if (list[0].id == id && lengths[{v.x(), v.y(), v.z()}] == 2) ++overflowed;
    }
  }
  EXPECT_GT(overflowed, 10U) << "the toys did not meet in the table";
}

TEST(AnchoredProperties, TheIndexDependsOnPosesAndNotOnTheirPath) {
  const auto walked = MappedToys(Method::kTsdfppAnchored, ToyConfig(), 3);
  const auto direct = walked->Clone();
  const auto still = walked->Clone();
  const Scene scene = TableWithToys();
  Dice dice(5);
  for (int i = 0; i < 50; ++i) {
    const auto id = static_cast<InstanceId>(1 + dice.Whole(3));
    walked->SetObjectPose(
        id, MakePose(dice.Uniform(-3, 3), {dice.Uniform(-1, 1), 0.3, 0.5},
                     {dice.Uniform(-0.1, 0.1), dice.Uniform(-0.1, 0.1), dice.Uniform(0, 0.1)}));
  }
  EXPECT_FALSE(SameLists(*walked, *direct));
  for (const InstanceId id : {kBrick, kBall, kTray}) {
    const Pose end = MakePose(0.7 * id, {0.1, 0.2, 1}, {0.02 * id, 0.03, 0.06});
    walked->SetObjectPose(id, end);
    direct->SetObjectPose(id, end);
  }
  EXPECT_TRUE(SameLists(*walked, *direct));
  EXPECT_TRUE(SnapshotOf(*walked, ToyIds()) == SnapshotOf(*direct, ToyIds()));
  for (const InstanceId id : {kBrick, kBall, kTray}) {
    EXPECT_NE(walked->ObjectLattice(id).matrix(), Pose::Identity().matrix());
    walked->SetObjectPose(id, scene.T_WO.at(id));
    EXPECT_EQ(walked->ObjectLattice(id).matrix(), Pose::Identity().matrix());
  }
  EXPECT_TRUE(SnapshotOf(*walked, ToyIds()) == SnapshotOf(*still, ToyIds()));
}

// Ten thousand small steps of two toys, the index asked for now and then; the last one ends at the
// same numbers as the one direct move.
TEST(AnchoredProperties, TenThousandSmallMovesLeaveTheIndexOfOneMove) {
  constexpr int kMoves = 10000;
  constexpr int kMovesBetweenQueries = 997;
  const auto walked = MappedToys(Method::kTsdfppAnchored, ToyConfig(), 3);
  const auto direct = walked->Clone();
  const auto still = walked->Clone();
  Scene scene = TableWithToys();
  Dice dice(11);
  for (int i = 0; i < kMoves; ++i) {
    const InstanceId id = i % 2 == 0 ? kBrick : kBall;
    Pose& T_WO = scene.T_WO.at(id);
    // Up to 0.2 voxels and half a degree; each is drawn to where neither was before, so that what
    // it leaves behind in the index is nobody else's to clear.
    const Eigen::Vector3d to_end =
        Eigen::Vector3d(0.3, id == kBrick ? 0.25 : -0.25, T_WO.translation().z()) -
        T_WO.translation();
    T_WO.translation() +=
        0.01 * to_end + Eigen::Vector3d(dice.Uniform(-0.004, 0.004), dice.Uniform(-0.004, 0.004),
                                        dice.Uniform(-0.001, 0.001));
    T_WO.linear() = (Eigen::AngleAxisd(dice.Uniform(-0.009, 0.009), Eigen::Vector3d::UnitZ()) *
                     Eigen::Quaterniond(T_WO.linear()).normalized())
                        .toRotationMatrix();
    walked->SetObjectPose(id, T_WO);
    if (i % kMovesBetweenQueries == 0) {
      ASSERT_FALSE(VoxelsOf(*walked).ListedVoxels().empty());
    }
  }
  for (const InstanceId id : {kBrick, kBall}) {
    direct->SetObjectPose(id, scene.T_WO.at(id));
    EXPECT_EQ(walked->ObjectLattice(id).matrix(), direct->ObjectLattice(id).matrix());
  }
  EXPECT_TRUE(SameLists(*walked, *direct));
  EXPECT_FALSE(SameLists(*walked, *still)) << "nothing was moved";
  EXPECT_TRUE(SnapshotOf(*walked, ToyIds()) == SnapshotOf(*direct, ToyIds()));
  std::string walked_scene;
  std::string direct_scene;
  AppendMesh(walked->SceneMesh(), walked_scene);
  AppendMesh(direct->SceneMesh(), direct_scene);
  EXPECT_GT(walked_scene.size(), 20000U);
  EXPECT_TRUE(walked_scene == direct_scene);
}

TEST(TsdfppProperties, OnAStaticSceneItsVolumesAreAnchoreds) {
  MapConfig config = ToyConfig();
  config.layers = 4;
  const auto tsdfpp = MappedToys(Method::kTsdfpp, config, 4);
  const auto anchored = MappedToys(Method::kTsdfppAnchored, config, 4);
  for (const InstanceId id : ToyIds()) {
    EXPECT_TRUE(SameObject(*tsdfpp, *anchored, id));
    std::string a;
    std::string b;
    AppendMesh(tsdfpp->ObjectMesh(id), a);
    AppendMesh(anchored->ObjectMesh(id), b);
    EXPECT_GT(a.size(), 1000U) << id;
    EXPECT_TRUE(a == b) << "mesh of " << id;
  }
  // Who is listed is the same too; only the order may differ.
  ASSERT_TRUE(SameVoxels(VoxelsOf(*tsdfpp).ListedVoxels(), VoxelsOf(*anchored).ListedVoxels()));
  for (const auto& v : VoxelsOf(*tsdfpp).ListedVoxels()) {
    std::set<InstanceId> a;
    std::set<InstanceId> b;
    for (const Listing& entry : VoxelsOf(*tsdfpp).ListAt(v)) a.insert(entry.id);
    for (const Listing& entry : VoxelsOf(*anchored).ListAt(v)) b.insert(entry.id);
    ASSERT_EQ(a, b) << Text(v);
  }
}

// Each move by resampling loses the voxels at the rim of what was observed.
TEST(TsdfppProperties, MovesErodeVolumesButNotAnchoredOnes) {
  const auto resampled = MappedToys(Method::kTsdfpp, ToyConfig(), 3);
  const auto anchored = MappedToys(Method::kTsdfppAnchored, ToyConfig(), 3);
  const std::size_t at_first = anchored->ObjectMesh(kBrick).triangles.size();
  std::size_t last = resampled->ObjectMesh(kBrick).triangles.size();
  ASSERT_EQ(last, at_first);
  ASSERT_GT(last, 100U);
  for (int i = 1; i <= 4; ++i) {
    const Pose pose = MakePose(0.3 + 0.1 * i, Eigen::Vector3d::UnitZ(),
                               {-0.14 + 0.01 * i, 0.03, kTableTop_m + 0.045});
    resampled->SetObjectPose(kBrick, pose);
    anchored->SetObjectPose(kBrick, pose);
    const std::size_t now = resampled->ObjectMesh(kBrick).triangles.size();
    EXPECT_LT(now, last) << "move " << i;
    EXPECT_EQ(anchored->ObjectMesh(kBrick).triangles.size(), at_first);
    last = now;
  }
  EXPECT_LT(last, at_first * 3 / 4);
}

// Where all neighbours are observed the two ways to resample are one; the other adds the rim.
TEST(TsdfppProperties, ObservedResamplingKeepsTheRimAndTheSameInside) {
  MapConfig config = ToyConfig();
  const auto all = MappedToys(Method::kTsdfpp, config, 3);
  config.resampling = Resampling::kObserved;
  const auto observed = MappedToys(Method::kTsdfpp, config, 3);
  const std::size_t at_first = VoxelsOf(*all).ObservedVoxels(kBrick).size();
  const Pose pose = MakePose(0.45, Eigen::Vector3d::UnitZ(), {-0.13, 0.04, kTableTop_m + 0.045});
  all->SetObjectPose(kBrick, pose);
  observed->SetObjectPose(kBrick, pose);
  for (const auto& v : VoxelsOf(*all).ObservedVoxels(kBrick)) {
    ASSERT_TRUE(
        SameValue(VoxelsOf(*observed).ValueAt(kBrick, v), VoxelsOf(*all).ValueAt(kBrick, v)))
        << Text(v);
  }
  // A tenth: rounding gives and takes at the rim alike, so that the volume stays about as large.
  EXPECT_LT(VoxelsOf(*all).ObservedVoxels(kBrick).size(), at_first * 9 / 10);
  EXPECT_GT(VoxelsOf(*observed).ObservedVoxels(kBrick).size(), at_first * 9 / 10);
  EXPECT_LT(VoxelsOf(*observed).ObservedVoxels(kBrick).size(), at_first * 11 / 10);
}

}  // namespace
}  // namespace tsdfpp
