// Visible fractions, boxes and hidden samples of flat plates whose images are known.
#include "eval/truth/visibility_truth.h"

#include <gtest/gtest.h>

#include <algorithm>

namespace tsdfpp {
namespace {

// Focal length in pixels; at one metre a centimetre is a pixel.
constexpr double kFocal_px = 100;

// A square plate that faces the camera, side 20 cm, around its own origin.
TrueModel Plate(InstanceId id, const std::string& name) {
  TrueModel model;
  model.info = {id, name, ""};
  constexpr float kHalf_m = 0.1F;
  model.mesh_O.vertices = {{-kHalf_m, -kHalf_m, 0},
                           {kHalf_m, -kHalf_m, 0},
                           {kHalf_m, kHalf_m, 0},
                           {-kHalf_m, kHalf_m, 0}};
  model.mesh_O.triangles = {{0, 2, 1}, {0, 3, 2}};  // normal towards -z, to the camera
  model.regions = {name};
  model.face_region = {0, 0};
  return model;
}

Pose At(double x, double y, double z) { return Pose(Eigen::Translation3d(x, y, z)); }

// 41x31 pixels, empty: depth 5 m all around.
Frame EmptyFrame() {
  Frame frame;
  frame.index = 3;
  frame.intrinsics = {41, 31, kFocal_px, kFocal_px, 20, 15};
  frame.depth = cv::Mat(31, 41, CV_32FC1, cv::Scalar(5));
  frame.mask = cv::Mat(31, 41, CV_16UC1, cv::Scalar(0));
  return frame;
}

void Draw(Frame& frame, InstanceId id, float depth, int u0, int u1, int v0, int v1) {
  for (int v = std::max(0, v0); v <= std::min(30, v1); ++v) {
    for (int u = std::max(0, u0); u <= std::min(40, u1); ++u) {
      frame.depth.at<float>(v, u) = depth;
      frame.mask.at<InstanceId>(v, u) = id;
    }
  }
}

// Shifted by a quarter of a pixel, so that no edge runs through pixel centres: the plate covers 20
// by 20 centres, u 10 to 29.
constexpr double kQuarter_m = 0.0025;

TEST(VisibilityTruth, AnUncoveredPlate) {
  VisibilityTruth truth({Plate(1, "far")});
  Frame frame = EmptyFrame();
  frame.T_WO[1] = At(-kQuarter_m, -kQuarter_m, 1);
  Draw(frame, 1, 1.0F, 10, 29, 5, 24);
  const auto all = truth.Measure(frame);
  ASSERT_TRUE(all.has_value()) << all.error().message;
  ASSERT_EQ(all->size(), 1U);
  const ObjectVisibility& o = all->front();
  EXPECT_EQ(o.frame, 3);
  EXPECT_EQ(o.visible_px, 400);
  EXPECT_EQ(o.silhouette_px, 400);
  EXPECT_DOUBLE_EQ(o.visible_fraction, 1);
  EXPECT_EQ(o.visible_box, (PixelBox{10, 5, 20, 20}));
  EXPECT_EQ(o.silhouette_box, (PixelBox{10, 5, 20, 20}));
  EXPECT_EQ(o.samples, 800);  // two a square centimetre
  EXPECT_EQ(o.behind_itself + o.outside, 0);
  EXPECT_TRUE(o.hidden_by.empty());
  // A strip of a quarter of a pixel on two sides falls on pixels beside the plate.
  EXPECT_GT(o.seen, 0.95 * 800);
  EXPECT_EQ(o.seen + o.unmeasured, 800);
}

// The near plate covers the left half of the far one: at half the distance it looks twice as large.
TEST(VisibilityTruth, AHalfHiddenPlateNamesWhoHidesIt) {
  VisibilityTruth truth({Plate(2, "near"), Plate(1, "far")});
  Frame frame = EmptyFrame();
  frame.T_WO[1] = At(-kQuarter_m, -kQuarter_m, 1);
  frame.T_WO[2] = At(-0.1 - kQuarter_m / 2, -kQuarter_m / 2, 0.5);  // u -20 to 19, v -5 to 34
  Draw(frame, 1, 1.0F, 10, 29, 5, 24);
  Draw(frame, 2, 0.5F, -20, 19, -5, 34);
  const auto all = truth.Measure(frame);
  ASSERT_TRUE(all.has_value()) << all.error().message;
  ASSERT_EQ(all->size(), 2U);
  const ObjectVisibility& far = all->at(0);
  EXPECT_EQ(far.id, 1);
  EXPECT_EQ(far.visible_px, 200);
  EXPECT_EQ(far.silhouette_px, 400);
  EXPECT_DOUBLE_EQ(far.visible_fraction, 0.5);
  EXPECT_EQ(far.visible_box, (PixelBox{20, 5, 10, 20}));
  EXPECT_EQ(far.silhouette_box, (PixelBox{10, 5, 20, 20}));
  ASSERT_TRUE(far.hidden_by.contains(2));
  EXPECT_EQ(far.hidden_by.size(), 1U);
  EXPECT_NEAR(static_cast<double>(far.hidden_by.at(2)), 400, 25);
  EXPECT_NEAR(static_cast<double>(far.seen), 400, 35);
  // Of the near one 20 of 40 columns and 31 of 40 rows are in the image; the silhouette is whole.
  const ObjectVisibility& near = all->at(1);
  EXPECT_EQ(near.visible_px, 20 * 31);
  EXPECT_EQ(near.silhouette_px, 1600);
  EXPECT_DOUBLE_EQ(near.visible_fraction, 20 * 31 / 1600.0);
  EXPECT_EQ(near.silhouette_box, (PixelBox{-20, -5, 40, 40}));
  EXPECT_GT(near.outside, 450);
}

TEST(VisibilityTruth, AnObjectWithoutAPoseHasNoLine) {
  VisibilityTruth truth({Plate(1, "far"), Plate(0, "background")});
  const auto all = truth.Measure(EmptyFrame());
  ASSERT_TRUE(all.has_value());
  ASSERT_EQ(all->size(), 1U);
  EXPECT_EQ(all->front().id, kBackground);
  EXPECT_EQ(all->front().visible_px, 41 * 31);
  EXPECT_EQ(all->front().silhouette_px, 0);
}

TEST(VisibilityTruth, ALineHoldsEveryColumn) {
  ObjectVisibility o{7,  2, 30, {1, 2, 3, 4},     60, {-5, 6, 7, 8}, 0.5, 100, 40,
                     30, 5, 5,  {{1, 12}, {3, 8}}};
  EXPECT_EQ(VisibilityLine(o), "7,2,30,1,2,3,4,60,-5,6,7,8,0.500000,100,40,30,5,5,1:12;3:8\n");
  const auto columns = [](const std::string& line) {
    return std::count(line.begin(), line.end(), ',');
  };
  EXPECT_EQ(columns(VisibilityHeader()), columns(VisibilityLine(o)));
}

}  // namespace
}  // namespace tsdfpp
