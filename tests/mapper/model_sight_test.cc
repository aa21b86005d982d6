// What of a model a frame shows, shows not to be there, or hides.
#include "mapper/track/model_sight.h"

#include <gtest/gtest.h>

#include <optional>

#include "mapper/map_representation.h"
#include "mapper/voxel_inspection.h"
#include "tests/mapper/toy_scene.h"

namespace tsdfpp {
namespace {

TEST(ModelSight, IsMatchedSeenThroughOrHidden) {
  reference::Scene scene = TableOnly();
  AddBrick(scene, 0.3, {-0.12, -0.06, kTableTop_m + 0.045});
  const Frame with =
      reference::Render(scene, CircleCamera(0.02), 1, {256, 192, 215.0, 215.0, 127.5, 95.5});
  const auto map = MakeMap(Method::kTsdfppAnchored, ToyConfig());
  map->SetObjectPose(kBrick, Pose::Identity());
  map->Fuse(with, with.mask);
  const TsdfGrid& model = *VoxelsOf(*map).GridOf(kBrick);
  const double margin_m = 3 * kToyVoxel_m;
  const auto look = [&](const Frame& frame) {
    return LookAtModel(frame, model, Pose::Identity(), kToyVoxel_m, margin_m);
  };
  const ModelSight there = look(with);
  EXPECT_GT(there.matched, 30);
  EXPECT_EQ(there.through, 0);
  Frame empty = with;
  empty.depth = cv::Mat(with.depth.size(), CV_32FC1, cv::Scalar(5));
  const ModelSight gone = look(empty);
  // At outlines some voxels have no depth around them.
  EXPECT_GE(gone.through, there.matched + there.hidden);
  EXPECT_LE(0.9 * gone.through, there.matched + there.hidden);
  EXPECT_EQ(gone.matched + gone.hidden, 0);
  Frame covered = with;
  covered.depth = cv::Mat(with.depth.size(), CV_32FC1, cv::Scalar(0.1));
  EXPECT_EQ(look(covered).hidden, gone.through);
  const ModelSight others = LookAtModel(with, model, Pose::Identity(), kToyVoxel_m, margin_m,
                                        cv::Mat::zeros(with.depth.size(), CV_8UC1));
  EXPECT_EQ(others.beside, there.matched);
  EXPECT_EQ(others.matched, 0);
  Frame unknown = with;
  unknown.depth = cv::Mat(with.depth.size(), CV_32FC1, cv::Scalar(0));
  const ModelSight nothing = look(unknown);
  EXPECT_EQ(nothing.matched + nothing.through + nothing.hidden, 0);
}

constexpr InstanceId kScreen = 9;

// A brick behind a screen that reaches so far to the right before it.
reference::Scene BehindScreen(std::optional<double> screen_end_m) {
  reference::Scene scene = TableOnly();
  AddBrick(scene, 0.3, {-0.12, -0.06, kTableTop_m + 0.045});
  if (screen_end_m) {
    constexpr double kHalf_m = 0.2;
    scene.shapes.push_back(reference::Cuboid(
        kScreen, {90, 90, 90},
        reference::MakePose(0, Eigen::Vector3d::UnitZ(), {0.1, *screen_end_m - kHalf_m, 0.1}),
        {0.005, kHalf_m, 0.15}));
  }
  return scene;
}

// Of a face that is seen at a flat angle voxels are more than pixels.
constexpr double kShareTolerance = 0.08;

TEST(ModelSight, FacingVoxelsAreShownAsPixelsAre) {
  const Intrinsics camera{256, 192, 215.0, 215.0, 127.5, 95.5};
  const auto render = [&](std::optional<double> screen_end_m) {
    return reference::Render(BehindScreen(screen_end_m), CircleCamera(0.02), 1, camera);
  };
  const Frame open = render(std::nullopt);
  MapConfig config = ToyConfig();
  config.voxel_m = kToyVoxel_m / 4;  // so that there are many
  const auto map = MakeMap(Method::kTsdfppAnchored, config);
  map->SetObjectPose(kBrick, Pose::Identity());
  map->Fuse(open, open.mask);
  const TsdfGrid& model = *VoxelsOf(*map).GridOf(kBrick);
  const auto look = [&](const Frame& frame, const Pose& T_WL = Pose::Identity()) {
    return LookAtFacing(frame, frame.mask, kBrick, model, T_WL, config.voxel_m, 2 * config.voxel_m);
  };
  const FacingVoxels all = look(open);
  EXPECT_GT(all.shown, 30);
  EXPECT_GT(all.ShownShare(), 1 - kShareTolerance);
  const int pixels = cv::countNonZero(open.mask == kBrick);
  int between = 0;
  for (int step = 0; step < 16; ++step) {
    const double end_m = -0.12 + 0.01 * step;
    const Frame frame = render(end_m);
    const double share = static_cast<double>(cv::countNonZero(frame.mask == kBrick)) / pixels;
    EXPECT_NEAR(look(frame).ShownShare(), share, kShareTolerance) << end_m;
    between += share > 0.1 && share < 0.9 ? 1 : 0;
  }
  EXPECT_GT(between, 5);
  const auto all_of = [&](InstanceId id, float depth_factor) {
    Frame frame = open;
    frame.depth = cv::Mat(depth_factor * open.depth);
    frame.mask = cv::Mat(open.mask.size(), CV_16UC1, cv::Scalar(id));
    return look(frame);
  };
  EXPECT_EQ(all_of(kScreen, 0.5F).ShownShare(), 0);
  EXPECT_EQ(all_of(kNoInstance, 0.5F).ShownShare(), 0);
  // What is farther covers nothing, nor does another's pixel with its depth, or without any.
  for (const float factor : {2.0F, 1.0F, 0.0F}) {
    const FacingVoxels unsaid = all_of(kScreen, factor);
    EXPECT_LT(unsaid.shown + unsaid.covered, kShareTolerance * all.shown) << factor;
  }
  // A table that a model is sunk into does not cover it.
  const FacingVoxels sunk = all_of(kBackground, 0.5F);
  EXPECT_EQ(sunk.shown + sunk.covered, 0);
  const Pose beside = reference::MakePose(0, Eigen::Vector3d::UnitZ(), {0, 5, 0});
  const FacingVoxels outside = look(open, beside);
  EXPECT_EQ(outside.shown + outside.covered, 0);
  EXPECT_EQ(outside.ShownShare(), 1);
}

}  // namespace
}  // namespace tsdfpp
