// Objects that are renamed, taken out of one map and put into another.
#include "mapper/methods/map_objects.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "mapper/map_editing.h"
#include "mapper/volume/object_volume.h"
#include "mapper/voxel_inspection.h"
#include "tests/mapper/compare_maps.h"
#include "tests/mapper/every_method.h"
#include "tests/mapper/map_snapshot.h"

namespace tsdfpp {
namespace {

using reference::MakePose;
using reference::Scene;

constexpr InstanceId kNew = 7;

class MapObjects : public EveryMethodTest {};
TSDFPP_FOR_EVERY_VOXEL_METHOD(MapObjects);

// The renamed brick goes on moving and being seen under its new name, and the ball goes on as it.
TEST_P(MapObjects, ARenamedObjectIsTheSameObject) {
  std::vector<InstanceId> ids = ToyIds();
  ids.push_back(kNew);
  SideBySide maps(GetParam(), ToyConfig(), ToyBox(), ids);
  Scene scene = TableWithToys();
  const auto frame_as = [&](InstanceId from, InstanceId to, Frame frame) {
    frame.mask.setTo(to, frame.mask == from);
    if (frame.T_WO.contains(from)) {
      frame.T_WO[to] = frame.T_WO.at(from);
      frame.T_WO.erase(from);
    }
    return frame;
  };
  maps.SetPosesAndFuse(RenderToys(scene, 0.2));
  scene.T_WO[kBrick].translation().x() += 0.05;
  maps.SetPosesAndFuse(RenderToys(scene, 0.4));
  maps.Rename(kBrick, kNew);
  scene.T_WO[kBrick].translation().x() += 0.03;
  maps.SetPosesAndFuse(frame_as(kBrick, kNew, RenderToys(scene, 0.6)));
  maps.Rename(kBall, kBrick);
  maps.SetObjectPose(kNew, MakePose(0.4, {0.1, 0, 1}, {0.05, 0.03, 0.06}));
  maps.SetObjectPose(kBrick, MakePose(0.4, {0.1, 0, 1}, {0.05, 0.05, 0.06}));
  maps.Remove(kNew);
  maps.Remove(kBrick);
  maps.CompareWholeBox();
}

TEST_P(MapObjects, RenamingThereAndBackChangesNothing) {
  const auto map = DrivenMap(GetParam(), ToyConfig(), 3);
  const std::string before = SnapshotOf(*map, ToyIds());
  ASSERT_TRUE(EditingOf(*map).Rename(kBrick, kNew).has_value());
  EXPECT_EQ(map->Objects(), (std::vector<InstanceId>{kBackground, kBall, kTray, kNew}));
  EXPECT_FALSE(SnapshotOf(*map, ToyIds()) == before);
  ASSERT_TRUE(EditingOf(*map).Rename(kNew, kBrick).has_value());
  EXPECT_TRUE(SnapshotOf(*map, ToyIds()) == before);
}

TEST_P(MapObjects, WhatCannotBeRenamedOrAddedIsRefused) {
  const auto map = DrivenMap(GetParam(), ToyConfig(), 1);
  map->SetObjectPose(9, Pose::Identity());  // never seen
  const std::string before = SnapshotOf(*map, ToyIds());
  const auto message = [](const Expected<void>& status) {
    EXPECT_FALSE(status.has_value());
    EXPECT_EQ(status.error().kind, ErrorKind::kUsage);
    return status.error().message;
  };
  EXPECT_EQ(message(EditingOf(*map).Rename(17, kNew)), "object 17 is not in the map");
  EXPECT_EQ(message(EditingOf(*map).Rename(kBrick, kBall)),
            "object 2 is in the map already, expected a new id");
  EXPECT_EQ(message(EditingOf(*map).Rename(kBrick, kBrick)),
            "object 1 is in the map already, expected a new id");
  EXPECT_EQ(message(EditingOf(*map).Rename(kBrick, 9)),
            "object 9 is in the map already, expected a new id");
  EXPECT_EQ(message(EditingOf(*map).Rename(kBackground, kNew)),
            "id 0 is the background, expected an object's");
  EXPECT_EQ(message(EditingOf(*map).Rename(kBrick, kNoInstance)),
            "id 65535 is kept for 'no object', expected an object's");
  const Pose here = Pose::Identity();
  EXPECT_EQ(message(EditingOf(*map).Add(kBall, {}, here, here)),
            "object 2 is in the map already, expected a new id");
  EXPECT_EQ(message(EditingOf(*map).Add(kBackground, {}, here, here)),
            "id 0 is the background, expected an object's");
  EXPECT_TRUE(SnapshotOf(*map, ToyIds()) == before);
}

// Out and in again: volumes with a lattice of their own, or none but the world's, are what they
// were.
TEST_P(MapObjects, AnObjectThatIsAddedHasTheVolumeThatItWasGiven) {
  const auto map = DrivenMap(GetParam(), ToyConfig(), 2);
  const TsdfGrid volume = CopyVolume(*map, kBrick);
  const Pose T_WL = map->ObjectLattice(kBrick);
  EXPECT_EQ(SameNumbers(T_WL, Pose::Identity()), !MovesLattices(GetParam()));
  const auto before = map->Clone();
  map->Remove(kBrick);
  const Pose T_WO = DriveFrame(1).T_WO.at(kBrick);
  ASSERT_TRUE(EditingOf(*map).Add(kNew, volume, T_WL, T_WO).has_value());
  EXPECT_EQ(VoxelsOf(*map).FindFault(), std::nullopt);
  std::size_t compared = 0;
  for (const auto& v : VoxelsOf(*before).ObservedVoxels(kBrick)) {
    const auto expected = VoxelsOf(*before).ValueAt(kBrick, v);
    ASSERT_TRUE(SameValue(VoxelsOf(*map).ValueAt(kNew, v), expected)) << Text(v);
    ++compared;
  }
  EXPECT_GT(compared, 150U);
  EXPECT_TRUE(
      SameVoxels(VoxelsOf(*map).ObservedVoxels(kNew), VoxelsOf(*before).ObservedVoxels(kBrick)));
  if (MovesLattices(GetParam())) {
    // The product of the poses is rounded.
    EXPECT_LT((map->ObjectLattice(kNew).matrix() - T_WL.matrix()).cwiseAbs().maxCoeff(), 1e-14);
  } else if (!IsOneField(GetParam())) {
    for (const auto& v : VoxelsOf(*map).ListedVoxels()) {
      const auto list = VoxelsOf(*map).ListAt(v);
      for (std::size_t i = 0; i < list.size(); ++i) {
        if (list[i].id != kNew) continue;
        ASSERT_EQ(i, 0U) << Text(v) << Text(list);
        ASSERT_EQ(list[i].confidence, ToyConfig().moved_confidence);
      }
    }
  }
  // It is an object like the others: it moves by its pose, and can be saved, seen and removed.
  map->SetObjectPose(kNew, T_WO);
  map->SetObjectPose(kNew, MakePose(0, Eigen::Vector3d::UnitZ(), {0.0, 0.0, 0.1}) * T_WO);
  EXPECT_EQ(VoxelsOf(*map).FindFault(), std::nullopt);
  EXPECT_FALSE(map->ObjectMesh(kNew).triangles.empty());
  map->Remove(kNew);
  EXPECT_EQ(VoxelsOf(*map).FindFault(), std::nullopt);
}

// Before it is given its first pose an object is where it was fused, and so it is out and in again.
TEST_P(MapObjects, AnObjectMayBeAddedWithoutAPose) {
  const auto map = MakeMap(GetParam(), ToyConfig());
  const Frame frame = DriveFrame(0);
  map->Fuse(frame, frame.mask);
  const TsdfGrid volume = CopyVolume(*map, kBrick);
  map->Remove(kBrick);
  const Pose aside = MakePose(0.4, {0.1, 0, 1}, {0.05, 0.03, 0.06});
  const auto own = EditingOf(*map).Add(kNew, volume, aside, std::nullopt);
  ASSERT_FALSE(own.has_value());
  EXPECT_EQ(own.error().message,
            "object 7 has no pose and a lattice of its own, expected that of the world");
  ASSERT_TRUE(EditingOf(*map).Add(kNew, volume, Pose::Identity(), std::nullopt));
  const TriangleMesh before = map->ObjectMesh(kNew);
  ASSERT_FALSE(before.triangles.empty());
  map->SetObjectPose(kNew, aside);
  EXPECT_TRUE(map->ObjectMesh(kNew).vertices == before.vertices);
  EXPECT_EQ(VoxelsOf(*map).FindFault(), std::nullopt);
}

// Another truncation distance, or more observations than this map counts: neither could be saved.
TEST_P(MapObjects, WhatAMapCannotHoldIsNotAdded) {
  constexpr int kFrames = 6;
  const auto map = DrivenMap(GetParam(), ToyConfig(), 1);
  const std::string before = SnapshotOf(*map, ToyIds());
  MapConfig longer = ToyConfig();
  longer.trunc_front_voxels = 8;
  const auto other = DrivenMap(GetParam(), longer, kFrames);
  const Pose T_WO = DriveFrame(kFrames - 1).T_WO.at(kBrick);
  const auto added =
      EditingOf(*map).Add(kNew, CopyVolume(*other, kBrick), other->ObjectLattice(kBrick), T_WO);
  ASSERT_FALSE(added.has_value());
  EXPECT_EQ(added.error().kind, ErrorKind::kData);
  EXPECT_TRUE(added.error().message.starts_with("object 7's volume has a voxel of distance"))
      << added.error().message;
  EXPECT_TRUE(SnapshotOf(*map, ToyIds()) == before);
}

// Even the greatest id that there may be, where objects are inside of one another.
TEST_P(MapObjects, RaysSeeTheSameWhateverTheIds) {
  constexpr InstanceId kGreatest = kNoInstance - 1;
  const auto map = DrivenMap(GetParam(), ToyConfig(), 3);
  const Pose ball = TableWithToys().T_WO.at(kBall);
  for (const double by_m : {0.0, 0.03}) {
    Pose T_WO = ball;
    T_WO.translation() += Eigen::Vector3d(by_m, 0.01, 0);
    const auto overlapping = map->Clone();
    overlapping->SetObjectPose(kBrick, T_WO);
    const Frame view = RenderToys(TableWithToys(), 0.2);
    const RaySurface expected = overlapping->CastRays(view.intrinsics, view.T_WC, {}).front();
    for (const InstanceId id : {kBrick, kBall, kTray}) {
      const auto renamed = overlapping->Clone();
      ASSERT_TRUE(EditingOf(*renamed).Rename(id, kGreatest));
      // Ties go by id.
      if (id == kBrick && MovesLattices(GetParam())) continue;
      RaySurface seen = renamed->CastRays(view.intrinsics, view.T_WC, {}).front();
      seen.id.setTo(static_cast<double>(id), seen.id == static_cast<double>(kGreatest));
      EXPECT_EQ(cv::countNonZero(seen.id != expected.id), 0) << id;
      EXPECT_EQ(cv::countNonZero(seen.depth != expected.depth), 0) << id;
    }
  }
}

// Into an empty map of each method, from an anchored one that has turned the object.
TEST_P(MapObjects, AnObjectComesFromAnotherMapAtItsPlace) {
  const auto other = DrivenMap(Method::kTsdfppAnchored, ToyConfig(), 4);
  const auto map = MakeMap(GetParam(), ToyConfig());
  const Pose T_WL = other->ObjectLattice(kBrick);
  ASSERT_FALSE(SameNumbers(T_WL, Pose::Identity()));
  ASSERT_TRUE(EditingOf(*map).Add(kNew, *VoxelsOf(*other).GridOf(kBrick), T_WL,
                                  DriveFrame(3).T_WO.at(kBrick)));
  EXPECT_EQ(VoxelsOf(*map).FindFault(), std::nullopt);
  EXPECT_EQ(map->Objects(), (std::vector<InstanceId>{kNew}));
  const TriangleMesh mesh = map->ObjectMesh(kNew);
  const TriangleMesh expected = other->ObjectMesh(kBrick);
  // Resampling erodes a surface at its rim (the reference tests say exactly how) and rounds edges.
  EXPECT_GT(mesh.triangles.size(), expected.triangles.size() / 4);
  for (const Eigen::Vector3f& p : mesh.vertices) {
    float nearest = 1;
    for (const Eigen::Vector3f& e : expected.vertices) nearest = std::min(nearest, (p - e).norm());
    ASSERT_LT(nearest, static_cast<float>(kToyVoxel_m));
  }
}

// Who fills a volume by hand sets distances and weights, and says nothing of masks.
TEST_P(MapObjects, MasksOfAnAddedVolumeNeedNotBeUpToDate) {
  const auto other = DrivenMap(Method::kTsdfppAnchored, ToyConfig(), 2);
  const TsdfGrid volume = CopyVolume(*other, kBrick);
  const TsdfGrid unmasked = CopyVolume(*other, kBrick);
  for (const auto& entry : unmasked.entries()) {
    for (BlockMask TsdfBlock::*mask : {&TsdfBlock::observed, &TsdfBlock::negative, &TsdfBlock::band,
                                       &TsdfBlock::crossed, &TsdfBlock::cover, &TsdfBlock::full}) {
      (*entry.block).*mask = {};
    }
  }
  const Pose T_WO = DriveFrame(1).T_WO.at(kBrick);
  const Pose aside = MakePose(0.4, {0.1, 0, 1}, {0.05, 0.03, 0.06});
  for (const Pose& T_WL : {Pose::Identity(), aside}) {
    const auto map = MakeMap(GetParam(), ToyConfig());
    const auto expected = MakeMap(GetParam(), ToyConfig());
    ASSERT_TRUE(EditingOf(*map).Add(kNew, unmasked, T_WL, T_WO));
    ASSERT_TRUE(EditingOf(*expected).Add(kNew, volume, T_WL, T_WO));
    EXPECT_EQ(VoxelsOf(*map).FindFault(), std::nullopt);
    EXPECT_FALSE(map->ObjectMesh(kNew).triangles.empty());
    EXPECT_TRUE(SnapshotOf(*map, {kNew}) == SnapshotOf(*expected, {kNew}));
  }
}

// Renames among the other events, at random, against the reference.
class RandomRenames : public ::testing::TestWithParam<std::tuple<Method, int>> {};
INSTANTIATE_TEST_SUITE_P(Seeds, RandomRenames,
                         ::testing::Combine(::testing::ValuesIn(VoxelMethods()),
                                            ::testing::Range(0, 4)));

TEST_P(RandomRenames, EveryEventLeavesTheSameVoxels) {
  const auto [method, seed] = GetParam();
  Dice dice(static_cast<std::uint64_t>(seed) + 100);
  std::vector<InstanceId> ids = ToyIds();
  for (const InstanceId id : {4, 5, 6}) ids.push_back(id);
  SideBySide maps(method, ToyConfig(), ToyBox(), ids);
  Scene scene = TableWithToys();
  std::map<InstanceId, InstanceId> name{{kBrick, kBrick}, {kBall, kBall}, {kTray, kTray}};
  std::map<InstanceId, InstanceId> other{{kBrick, 4}, {kBall, 5}, {kTray, 6}};
  for (int event = 0; event < 8 && !HasFailure(); ++event) {
    const auto toy = static_cast<InstanceId>(1 + dice.Whole(3));
    const bool is_known = event > 0;
    switch (is_known ? dice.Whole(4) : 3) {
      case 0:
        maps.Rename(name[toy], other[toy]);
        std::swap(name[toy], other[toy]);
        break;
      case 1:
        scene.T_WO[toy].translation() +=
            Eigen::Vector3d(dice.Uniform(-0.03, 0.03), dice.Uniform(-0.03, 0.03), 0);
        maps.SetObjectPose(name[toy], scene.T_WO[toy]);
        break;
      default: {
        const Frame seen = RenderToys(scene, dice.Uniform(0, 6.28));
        Frame frame = seen;
        frame.mask = seen.mask.clone();
        frame.T_WO.clear();
        for (const auto& [from, to] : name) {
          frame.mask.setTo(to, seen.mask == from);
          frame.T_WO[to] = seen.T_WO.at(from);
        }
        maps.SetPosesAndFuse(frame);
      }
    }
  }
}

}  // namespace
}  // namespace tsdfpp
