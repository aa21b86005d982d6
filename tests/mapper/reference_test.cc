// Every method against its dense reference, voxel by voxel, after each event.
#include <gtest/gtest.h>

#include <limits>
#include <numbers>
#include <string>
#include <tuple>

#include "mapper/voxel_inspection.h"
#include "tests/mapper/compare_maps.h"
#include "tests/mapper/toy_scene.h"

namespace tsdfpp {
namespace {

using reference::MakePose;
using reference::Scene;

std::string TestName(Method method) {
  std::string name(MethodName(method));
  for (char& c : name) {
    if (std::isalnum(static_cast<unsigned char>(c)) == 0) c = '_';
  }
  return name;
}

class ReferenceTest : public ::testing::TestWithParam<std::tuple<Method, double>> {
 protected:
  Method method() const { return std::get<0>(GetParam()); }
  MapConfig config() const { return ToyConfig(std::get<1>(GetParam())); }
  SideBySide Begin() const { return Begin(config()); }
  SideBySide Begin(const MapConfig& config) const {
    return SideBySide(method(), config, ToyBox(), ToyIds());
  }
  // Moves and turns of one voxel and half a voxel too, where the nearest neighbour is a tie.
  void CompareMoves(Resampling resampling) const {
    MapConfig changed = config();
    changed.resampling = resampling;
    Scene scene = TableWithToys();
    SideBySide maps = Begin(changed);
    maps.SetPosesAndFuse(RenderToys(scene, 0.2));
    scene.T_WO[kBrick].translation() += Eigen::Vector3d(kToyVoxel_m / 2, kToyVoxel_m, 0);
    maps.SetObjectPose(kBrick, scene.T_WO[kBrick]);
    scene.T_WO[kBall] = MakePose(0.7, {0.2, 0.1, 1}, {0.10, -0.06, kTableTop_m + 0.06});
    maps.SetPosesAndFuse(RenderToys(scene, 0.8));
    scene.T_WO[kBrick] = MakePose(0.9, Eigen::Vector3d::UnitZ(), {0.08, 0.09, kTableTop_m + 0.03});
    maps.SetPosesAndFuse(RenderToys(scene, 1.2));
    maps.CompareWholeBox();
  }
};

INSTANTIATE_TEST_SUITE_P(Methods, ReferenceTest,
                         ::testing::Combine(::testing::ValuesIn(AllMethods()),
                                            ::testing::Values(4.0, 2.0)),
                         [](const auto& parameters) {
                           return TestName(std::get<0>(parameters.param)) + "_back_" +
                                  std::to_string(static_cast<int>(std::get<1>(parameters.param)));
                         });

TEST_P(ReferenceTest, StaticScene) {
  const Scene scene = TableWithToys();
  SideBySide maps = Begin();
  for (int i = 0; i < 4; ++i) maps.SetPosesAndFuse(RenderToys(scene, 0.1 + 1.5 * i, i));
  for (const InstanceId id : ToyIds()) {
    EXPECT_GT(VoxelsOf(maps.map()).ObservedVoxels(id).size(), 200U)
        << "the scene shows too little of " << id;
  }
  maps.CompareWholeBox();
}

// The camera stands among blocks that are there, so that some of a block's voxels lie before it and
// some behind; upside down, so that the image's first pixel sees the table.
TEST_P(ReferenceTest, CameraAmongItsBlocks) {
  const Scene scene = TableWithToys();
  SideBySide maps = Begin();
  maps.SetPosesAndFuse(RenderToys(scene, 0.2));
  const Pose T_WC = reference::LookAt({0.03, 0.03, kTableTop_m + 0.06}, {0.3, 0.05, kTableTop_m});
  const Pose upside_down = MakePose(std::numbers::pi, Eigen::Vector3d::UnitZ(), {0, 0, 0});
  const Frame frame = reference::Render(scene, T_WC * upside_down, 2);
  ASSERT_TRUE(IsValidDepth(frame.depth.at<float>(0, 0)));
  maps.SetPosesAndFuse(frame);
}

// Eight millimetres over the brick's edge, an outline's reach is wider than the image.
TEST_P(ReferenceTest, CameraAtAnOutline) {
  const Scene scene = TableWithToys();
  SideBySide maps = Begin();
  maps.SetPosesAndFuse(RenderToys(scene, 0.2));
  const Eigen::Vector3d edge_W = scene.T_WO.at(kBrick) * Eigen::Vector3d(0, 0.05, 0.045);
  const Frame frame = reference::Render(scene,
                                        reference::LookAt(edge_W + Eigen::Vector3d(0, 0, 0.008),
                                                          edge_W + Eigen::Vector3d(0.002, 0, 0)),
                                        2);
  const cv::Mat is_brick = frame.mask == kBrick;
  ASSERT_GT(cv::countNonZero(is_brick), 0);
  ASSERT_LT(cv::countNonZero(is_brick), frame.mask.rows * frame.mask.cols);
  maps.SetPosesAndFuse(frame);
  maps.CompareWholeBox();
}

TEST_P(ReferenceTest, WeightsAndConfidencesSaturate) {
  const Scene scene = TableWithToys();
  MapConfig capped = config();
  capped.weight_cap = 2;
  capped.confidence_cap = 2;
  SideBySide maps = Begin(capped);
  for (int i = 0; i < 4; ++i) maps.SetPosesAndFuse(RenderToys(scene, 0.1 + 0.05 * i, i));
}

// Colour goes wherever distances do, and moves along.
TEST_P(ReferenceTest, ColoursOfTheWholeBand) {
  Scene scene = TableWithToys();
  MapConfig coloured = config();
  coloured.colour_whole_band = true;
  SideBySide maps = Begin(coloured);
  maps.SetPosesAndFuse(RenderToys(scene, 0.2));
  scene.T_WO[kBrick].translation() += Eigen::Vector3d(0.03, 0.01, 0.02);
  maps.SetPosesAndFuse(RenderToys(scene, 0.8));
  maps.CompareWholeBox();
}

// A brick drives and turns over the table while a ball rolls towards it and the tray stays.
TEST_P(ReferenceTest, ObjectsDriveAndTurn) {
  Scene scene = TableWithToys();
  SideBySide maps = Begin();
  maps.SetPosesAndFuse(RenderToys(scene, 0.2));
  for (int i = 1; i <= 5; ++i) {
    scene.T_WO[kBrick] = MakePose(0.3 + 0.25 * i, Eigen::Vector3d::UnitZ(),
                                  {-0.14 + 0.04 * i, 0.03 - 0.01 * i, kTableTop_m + 0.045});
    scene.T_WO[kBall] =
        MakePose(0.3 * i, {0, 1, 0.2}, {0.12 - 0.015 * i, -0.08, kTableTop_m + 0.055});
    maps.SetPosesAndFuse(RenderToys(scene, 0.2 + 0.3 * i, i));
  }
  maps.CompareWholeBox();
}

// Whole voxels and quarter turns put every source point on lattice points or beside them.
TEST_P(ReferenceTest, MovesByWholeVoxels) {
  Scene scene = TableWithToys();
  SideBySide maps = Begin();
  maps.SetPosesAndFuse(RenderToys(scene, 0.2));
  scene.T_WO[kBrick].translation() += Eigen::Vector3d(3 * kToyVoxel_m, 0, 0);
  maps.SetObjectPose(kBrick, scene.T_WO[kBrick]);
  scene.T_WO[kBall].translation() += Eigen::Vector3d(0, kToyVoxel_m, 2 * kToyVoxel_m);
  maps.SetPosesAndFuse(RenderToys(scene, 0.8));
  maps.CompareWholeBox();
}

TEST_P(ReferenceTest, RemovalAndReturn) {
  Scene scene = TableWithToys();
  SideBySide maps = Begin();
  maps.SetPosesAndFuse(RenderToys(scene, 0.2));
  scene.T_WO[kBrick].translation().x() += 0.09;
  maps.SetPosesAndFuse(RenderToys(scene, 0.4));
  maps.Remove(kBrick);
  maps.Remove(17);                               // unknown: nothing
  maps.SetPosesAndFuse(RenderToys(scene, 0.6));  // it is still in the world, so it comes back
  scene.T_WO[kBrick].translation().y() += 0.05;
  maps.SetPosesAndFuse(RenderToys(scene, 0.8));
  maps.Remove(kBrick);
  maps.Remove(kBall);
  maps.CompareWholeBox();
}

// One field that moves, and removes, what is near the surface alone, so that free space keeps its
// label; that makes what it removes unobserved; and in which only what is near a surface votes.
TEST_P(ReferenceTest, SettingsOfOneField) {
  if (!IsOneField(method())) return;
  MapConfig near_surface = config();
  near_surface.moved_voxels = MovedVoxels::kNearSurface;
  near_surface.removed_voxels = RemovedVoxels::kUnobserved;
  near_surface.vote_band_voxels = 2;
  Scene scene = TableWithToys();
  SideBySide maps = Begin(near_surface);
  maps.SetPosesAndFuse(RenderToys(scene, 0.2));
  for (int i = 1; i <= 3; ++i) {
    scene.T_WO[kBrick] = MakePose(0.3 + 0.25 * i, Eigen::Vector3d::UnitZ(),
                                  {-0.14 + 0.04 * i, 0.03 - 0.01 * i, kTableTop_m + 0.045});
    maps.SetPosesAndFuse(RenderToys(scene, 0.2 + 0.3 * i, i));
  }
  maps.Remove(kBrick);
  EXPECT_FALSE(VoxelsOf(maps.map()).ObservedVoxels(kBrick).empty());
  maps.CompareWholeBox();
}

// Removal forgets the poses: the next one is the first, and moves nothing.
TEST_P(ReferenceTest, ReturnBeforeItsFirstPose) {
  Scene scene = TableWithToys();
  SideBySide maps = Begin();
  maps.SetPosesAndFuse(RenderToys(scene, 0.2));
  maps.Remove(kBrick);
  scene.T_WO[kBrick].translation().x() += 0.09;
  Frame frame = RenderToys(scene, 0.4);
  frame.T_WO.erase(kBrick);
  maps.SetPosesAndFuse(frame);
  ASSERT_FALSE(VoxelsOf(maps.map()).ObservedVoxels(kBrick).empty());
  maps.SetObjectPose(kBrick, scene.T_WO[kBrick]);
}

TEST_P(ReferenceTest, RemovalListsAgain) {
  MapConfig relisting = config();
  relisting.relist_on_removal = true;
  Scene scene = TableWithToys();
  SideBySide maps = Begin(relisting);
  maps.SetPosesAndFuse(RenderToys(scene, 0.2));
  // Both in the tray, so that lists of two overflow.
  scene.T_WO[kBall].translation() = Eigen::Vector3d(0.08, 0.10, kTableTop_m + 0.04);
  scene.T_WO[kBrick].translation() = Eigen::Vector3d(0.07, 0.08, kTableTop_m + 0.03);
  maps.SetPosesAndFuse(RenderToys(scene, 0.5));
  maps.Remove(kBrick);
  maps.Remove(kTray);
}

// What a move wrote into new blocks is there to be fused into: here the table is seen through it.
TEST_P(ReferenceTest, MovesIntoTheAirAndIsSeenThrough) {
  Scene scene = TableWithToys();
  SideBySide maps = Begin();
  maps.SetPosesAndFuse(RenderToys(scene, 0.2));
  scene.T_WO[kBrick].translation() += Eigen::Vector3d(0.02, 0, 0.21);
  maps.SetObjectPose(kBrick, scene.T_WO[kBrick]);
  const Pose from_above = reference::LookAt({-0.09, -0.03, 0.6}, {-0.1, 0.03, 0});
  maps.SetPosesAndFuse(reference::Render(TableOnly(), from_above));
  maps.CompareWholeBox();
}

// A brick is set over the ball on the tray on the table: four objects claim the same voxels.
TEST_P(ReferenceTest, ThreeObjectsAtOnePlace) {
  Scene scene = TableOnly();
  AddTray(scene, 0.2, {0.03, 0.02, kTableTop_m + 0.016});
  SideBySide maps = Begin();
  maps.SetPosesAndFuse(RenderToys(TableOnly(), 0.1));
  maps.SetPosesAndFuse(RenderToys(scene, 0.3));
  AddBall(scene, {0.03, 0.02, kTableTop_m + 0.04});
  maps.SetPosesAndFuse(RenderToys(scene, 0.6));
  AddBrick(scene, 0.7, {-0.15, -0.1, kTableTop_m + 0.045});
  maps.SetPosesAndFuse(RenderToys(scene, 0.9));
  scene.T_WO[kBrick] = MakePose(1.1, Eigen::Vector3d::UnitZ(), {0.035, 0.025, kTableTop_m + 0.03});
  maps.SetPosesAndFuse(RenderToys(scene, 1.2));
  std::size_t longest = 0;
  for (const auto& v : VoxelsOf(maps.map()).ListedVoxels()) {
    longest = std::max(longest, VoxelsOf(maps.map()).ListAt(v).size());
  }
  // A thin band does not reach from the brick's top through all that is below it.
  const int together = std::get<1>(GetParam()) < 4 ? 3 : 4;
  EXPECT_GE(static_cast<int>(longest), std::min(LayersOf(method(), config()), together));
  EXPECT_LE(static_cast<int>(longest), LayersOf(method(), config()));
  maps.Remove(kBrick);
  maps.Remove(kBall);
  maps.CompareWholeBox();
}

TEST_P(ReferenceTest, AbsentAndPoselessObjects) {
  Scene scene = TableWithToys();
  SideBySide maps = Begin();
  Frame frame = RenderToys(scene, 0.2);
  frame.T_WO.erase(kTray);  // the tray never gets a pose
  maps.SetPosesAndFuse(frame);
  scene.T_WO[kBrick].translation().x() += 0.05;
  frame = RenderToys(scene, 0.5);
  frame.T_WO.erase(kTray);
  frame.T_WO.erase(kBrick);  // seen, but its pose is not given: it stays where it was
  maps.SetPosesAndFuse(frame);
  Scene without = scene;
  without.Erase(kBall);  // neither seen nor given
  frame = RenderToys(without, 0.7);
  frame.T_WO.erase(kTray);
  maps.SetPosesAndFuse(frame);
  maps.SetObjectPose(9, MakePose(1, Eigen::Vector3d::UnitZ(), {1, 2, 3}));  // never seen
  maps.SetObjectPose(9, MakePose(2, Eigen::Vector3d::UnitZ(), {1, 2, 3}));
}

TEST_P(ReferenceTest, InvalidDepthAndNoLabel) {
  const Scene scene = TableWithToys();
  SideBySide maps = Begin();
  Frame frame = RenderToys(scene, 0.2);
  const std::array<float, 5> invalid = {0.0F, -1.0F, 101.0F,
                                        std::numeric_limits<float>::quiet_NaN(),
                                        std::numeric_limits<float>::infinity()};
  for (int v = 20; v < 50; ++v) {
    for (int u = 30; u < 60; ++u) {
      if ((u + v) % 3 == 0) frame.depth.at<float>(v, u) = invalid[(u * 7 + v) % invalid.size()];
    }
  }
  maps.SetPosesAndFuse(frame);
  cv::Mat labels = frame.mask.clone();
  labels(cv::Rect(40, 30, 25, 12)).setTo(kNoInstance);
  maps.SetPosesAndFuse(RenderToys(scene, 0.25), labels);
  frame.depth.setTo(0);
  maps.SetPosesAndFuse(frame);
  maps.CompareWholeBox();
}

TEST_P(ReferenceTest, ResamplingFromTheObservedNeighbours) { CompareMoves(Resampling::kObserved); }

TEST_P(ReferenceTest, ResamplingFromTheNearestNeighbour) { CompareMoves(Resampling::kNearest); }

TEST_P(ReferenceTest, WithoutContradiction) {
  MapConfig trusting = config();
  trusting.contradiction = false;
  Scene scene = TableWithToys();
  SideBySide maps = Begin(trusting);
  maps.SetPosesAndFuse(RenderToys(scene, 0.2));
  scene.Erase(kBall);
  maps.SetPosesAndFuse(RenderToys(scene, 0.3));
}

}  // namespace
}  // namespace tsdfpp
