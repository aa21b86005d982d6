// What of a model a frame shows, shows not to be there, or hides.
#include "mapper/track/model_sight.h"

#include <gtest/gtest.h>

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

}  // namespace
}  // namespace tsdfpp
