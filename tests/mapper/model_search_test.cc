// Where a model is in a frame of which nothing is known but a segment.
#include "mapper/track/model_search.h"

#include <gtest/gtest.h>

#include "core/units.h"
#include "mapper/track/object_model.h"
#include "mapper/track/segment_look.h"
#include "tests/mapper/every_method.h"
#include "tests/mapper/toy_scene.h"

namespace tsdfpp {
namespace {

using reference::MakePose;

const Eigen::Vector3d kBefore(-0.12, -0.06, kTableTop_m + 0.045);
constexpr double kYaw_rad = 0.3;
// Half of what is seen is new; a voxel at the end of the brick's 150 mm is 7.6 degrees.
constexpr double kMost_voxels = 1;
constexpr double kMost_deg = 6;

// A brick with a knob and an arm stands at a place, turned as ever, and is seen from a side.
Frame FrameOf(int index, const Eigen::Vector3d& place, double side_rad) {
  reference::Scene scene = TableOnly();
  AddKnobbedBrick(scene, kYaw_rad, place);
  scene.shapes.push_back(reference::Cuboid(
      kBrick, {200, 30, 30}, MakePose(0, Eigen::Vector3d::UnitZ(), {-0.05, -0.07, -0.02}),
      {0.025, 0.04, 0.025}));
  return reference::Render(scene, CircleCamera(side_rad), index,
                           {256, 192, 215.0, 215.0, 127.5, 95.5});
}

class ModelSearchTest : public testing::TestWithParam<int> {};

// More and more of what is seen is new, and of the model out of sight: at 60 degrees another place,
// half a turn away, fits nearly as well.
TEST_P(ModelSearchTest, FindsWhatMovedWithoutATurn) {
  const auto map = MakeMap(Method::kTsdfppAnchored, ToyConfig());
  for (int i = 0; i < 5; ++i) SetPosesThenFuse(*map, FrameOf(i, kBefore, 0.02 * i));
  const auto model = ModelOf(*map, kBrick);
  ASSERT_TRUE(model.has_value());
  const Eigen::Vector3d after = kBefore + Eigen::Vector3d(0.15, 0.08, 0);
  const Frame frame = FrameOf(9, after, GetParam() * kDegree);
  const LoosePixels pixels = PixelsByLabel(frame.mask, 0).at(kBrick);
  const SdfTrackConfig config;
  const SegmentLook look = LookAtSegment(frame, pixels, kToyVoxel_m, config);
  const ModelSearch search{&frame,      &look.points, (frame.mask == kBrick),
                           model->grid, model->T_WL,  kToyVoxel_m};
  const auto found = FindModel(search, config);
  ASSERT_TRUE(found.has_value());
  const Pose T_WL = frame.T_WC * found->T_LC.inverse();
  const Pose moved = T_WL * model->T_WL.inverse();
  EXPECT_LT((moved * kBefore - after).norm(), kMost_voxels * kToyVoxel_m);
  EXPECT_LT(Eigen::AngleAxisd(moved.linear()).angle(), kMost_deg * kDegree);
  EXPECT_EQ(IsCertain(*found), GetParam() != 60);
}

INSTANTIATE_TEST_SUITE_P(Sides, ModelSearchTest, testing::Values(20, 40, 60, 280, 320, 340));

}  // namespace
}  // namespace tsdfpp
