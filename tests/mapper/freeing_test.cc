// Blocks that hold nothing are freed (docs/map.md, "Freeing"): what is kept is what is needed, and
// memory is bounded however long a map lives.
#include <gtest/gtest.h>

#include <set>

#include "mapper/map_editing.h"
#include "mapper/voxel_inspection.h"
#include "tests/mapper/every_method.h"
#include "tests/mapper/mesh_checks.h"

namespace tsdfpp {
namespace {

using reference::MakePose;
using reference::Scene;

class Freeing : public EveryMethodTest {};
TSDFPP_FOR_EVERY_VOXEL_METHOD(Freeing);

std::size_t BlocksOf(const std::vector<Eigen::Vector3i>& voxels) {
  std::set<VoxelKey> blocks;
  for (const auto& v : voxels) blocks.insert({v.x() >> 3, v.y() >> 3, v.z() >> 3});
  return blocks.size();
}

// What the values and the lists alone say must be stored.
std::size_t BlocksNeeded(const MapRepresentation& map, Method method) {
  if (IsOneField(method)) {
    std::vector<Eigen::Vector3i> observed;
    for (const auto& entry : VoxelsOf(map).GridOf(kBackground)->entries()) {
      if (entry.block->AnyObserved())
        observed.push_back(8 * Eigen::Vector3i(entry.index.x, entry.index.y, entry.index.z));
    }
    return BlocksOf(observed);
  }
  std::size_t blocks = KeepsLists(method) ? BlocksOf(VoxelsOf(map).ListedVoxels()) : 0;
  for (const InstanceId id : ToyIds()) blocks += BlocksOf(VoxelsOf(map).ObservedVoxels(id));
  return blocks;
}

TEST_P(Freeing, OnlyBlocksThatHoldSomethingAreKept) {
  const auto map = MakeMap(GetParam(), ToyConfig());
  Scene scene = TableWithToys();
  Dice dice(11);
  for (int i = 0; i < 12; ++i) {
    scene.T_WO[kBrick] =
        MakePose(0.4 * i, Eigen::Vector3d::UnitZ(),
                 {dice.Uniform(-0.13, 0.13), dice.Uniform(-0.13, 0.13), kTableTop_m + 0.045});
    SetPosesThenFuse(*map, RenderToys(scene, 0.5 * i, i));
    ASSERT_EQ(map->Memory().blocks, BlocksNeeded(*map, GetParam())) << "frame " << i;
    if (i != 8) continue;
    map->Remove(kTray);
    ASSERT_EQ(map->Memory().blocks, BlocksNeeded(*map, GetParam()));
  }
  map->SetObjectPose(kBall, MakePose(0, Eigen::Vector3d::UnitZ(), {0.1, 0.1, 0.3}));
  VoxelsOf(*map).ListedVoxels();  // the index of anchored is made when it is asked for
  EXPECT_EQ(map->Memory().blocks, BlocksNeeded(*map, GetParam()));
  for (const InstanceId id : map->Objects()) map->Remove(id);
  // Free space that no observation in band ever labelled stays.
  if (IsOneField(GetParam())) return;
  EXPECT_EQ(map->Memory().blocks, 0U);
}

// A mask of a pixel that no voxel lies behind leaves nothing of its object, not even its id.
TEST_P(Freeing, WhatWasFusedInVainIsNotThere) {
  constexpr InstanceId kSpeck = 9;
  const Frame frame = RenderToys(TableWithToys(), 0.2);
  const auto without = MakeMap(GetParam(), ToyConfig());
  Frame beside = frame;
  int in_vain = 0;
  for (int pixel = 5; pixel < frame.mask.cols / 2; pixel += 4) {
    beside.mask = frame.mask.clone();
    const cv::Point at(pixel, frame.mask.rows / 2);
    beside.mask.at<InstanceId>(at) = kSpeck;
    const auto map = without->Clone();
    map->Fuse(beside, beside.mask);
    if (!VoxelsOf(*map).ObservedVoxels(kSpeck).empty()) continue;
    ++in_vain;
    EXPECT_TRUE(EditingOf(*map).Add(kSpeck, {}, Pose::Identity(), std::nullopt));
    // Nor does it stay where it was put so.
    map->Fuse(frame, frame.mask);
    EXPECT_EQ(VoxelsOf(*map).FindFault(), std::nullopt);
    EXPECT_TRUE(EditingOf(*map).Add(kSpeck, {}, Pose::Identity(), std::nullopt));
  }
  EXPECT_GT(in_vain, 0);
}

// Forty cameras around the table, again and again.
TEST_P(Freeing, AStaticSceneDoesNotGrow) {
  const auto map = MakeMap(GetParam(), ToyConfig());
  std::vector<Frame> frames;
  frames.reserve(40);
  for (int i = 0; i < 40; ++i) frames.push_back(RenderToys(TableWithToys(), 0.157 * i, i));
  MapMemory settled;
  for (int i = 0; i < 1000; ++i) {
    SetPosesThenFuse(*map, frames[static_cast<std::size_t>(i) % frames.size()]);
    // What contradiction clears at an edge, and a later frame fuses again, settles soon.
    if (i == 199) settled = map->Memory();
  }
  EXPECT_LE(map->Memory().blocks, settled.blocks);
  EXPECT_LE(map->Memory().bytes, settled.bytes);
}

// The brick goes to and fro a thousand times; every tenth time it is seen.
TEST_P(Freeing, AnObjectThatGoesToAndFroDoesNotGrow) {
  const auto map = MakeMap(GetParam(), ToyConfig());
  Scene scene = TableWithToys();
  std::vector<Frame> frames;
  std::vector<Pose> poses;
  for (int i = 0; i < 20; ++i) {
    const double way = std::abs(10 - i) / 10.0;
    poses.push_back(MakePose(0.3 + 2 * way, Eigen::Vector3d::UnitZ(),
                             {-0.14 + 0.25 * way, 0.03 - 0.1 * way, kTableTop_m + 0.045}));
    scene.T_WO[kBrick] = poses.back();
    frames.push_back(RenderToys(scene, 0.3 * i, i));
  }
  std::size_t most_early = 0;
  std::size_t most_late = 0;
  for (int i = 0; i < 1000; ++i) {
    const auto k = static_cast<std::size_t>(i) % frames.size();
    if (i % 10 == 0) {
      SetPosesThenFuse(*map, frames[k]);
    } else {
      map->SetObjectPose(kBrick, poses[k]);
    }
    std::size_t& most = i < 200 ? most_early : most_late;
    most = std::max(most, map->Memory().bytes);
  }
  EXPECT_LE(most_late, most_early);
}

}  // namespace
}  // namespace tsdfpp
