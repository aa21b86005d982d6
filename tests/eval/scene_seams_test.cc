// The seams of the visible scene, where share and area are known in closed form.
#include "eval/score/scene_seams.h"

#include <gtest/gtest.h>

#include <cmath>

#include "eval/score/evaluation.h"
#include "eval/score/evaluation_columns.h"
#include "eval/score/mapped_pixels.h"
#include "tests/reference/analytic_scene.h"

namespace tsdfpp {
namespace {

constexpr double kSeamVoxel_m = 0.01;
constexpr InstanceId kStandsThere = 1;
const Intrinsics kSeamCamera{160, 120, 140.0, 100.0, 79.5, 59.5};
// The first column of the object; all columns before are background.
constexpr int kFirstOfObject = 90;
// A pixel's area is that of its plane at its centre: 1/z^3 varies by less over a pixel.
constexpr double kAreaTolerance = 1e-3;

// The wall z = depth + slope x, in the camera's frame; from kFirstOfObject on it is an object's.
struct WallOf {
  double depth_m = 0.8;
  double slope = 0;

  double DepthAt(double u) const {
    return depth_m / (1 - slope * (u - kSeamCamera.cx) / kSeamCamera.fx);
  }
  // Of the part of the wall seen between two columns' bounds, all rows: a trapezium.
  double Area_m2(double u0, double u1) const {
    const double z0 = DepthAt(u0);
    const double z1 = DepthAt(u1);
    const double x0 = (u0 - kSeamCamera.cx) / kSeamCamera.fx * z0;
    const double x1 = (u1 - kSeamCamera.cx) / kSeamCamera.fx * z1;
    const double along = std::hypot(x1 - x0, z1 - z0);
    return along * (z0 + z1) / 2 * kSeamCamera.height / kSeamCamera.fy;
  }
  Frame Seen() const {
    Frame frame;
    frame.intrinsics = kSeamCamera;
    frame.depth.create(kSeamCamera.height, kSeamCamera.width, CV_32FC1);
    for (int u = 0; u < kSeamCamera.width; ++u) {
      frame.depth.col(u).setTo(cv::Scalar(DepthAt(u)));
    }
    frame.mask = cv::Mat(frame.depth.size(), CV_16UC1, cv::Scalar(kBackground));
    frame.mask.colRange(kFirstOfObject, kSeamCamera.width).setTo(cv::Scalar(kStandsThere));
    return frame;
  }
  // How many columns of background the border has: the radius is of the edge's pixels.
  int BorderColumns() const {
    const double z = DepthAt(kFirstOfObject - 1);
    return 1 + std::max(2, static_cast<int>(std::ceil(1.5 * kSeamCamera.fx * kSeamVoxel_m / z)));
  }
};

cv::Mat Columns(const cv::Mat& depth, int first, int last, double value) {
  cv::Mat changed = depth.clone();
  changed.colRange(first, last + 1).setTo(cv::Scalar(value));
  return changed;
}

class Seams : public ::testing::TestWithParam<double> {};
INSTANTIATE_TEST_SUITE_P(Slopes, Seams, ::testing::Values(0.0, 0.7, -1.2));

TEST_P(Seams, OfAGapHaveItsShareAndArea) {
  const WallOf wall{0.8, GetParam()};
  const Frame frame = wall.Seen();
  const int border = wall.BorderColumns();
  const int first = kFirstOfObject - border;
  ASSERT_GE(border, 3);
  for (int width = 0; width <= border; ++width) {
    const cv::Mat cast =
        width == 0 ? frame.depth.clone()
                   : Columns(frame.depth, kFirstOfObject - width, kFirstOfObject - 1, 0.0);
    const SeamScores scores = ScoreSeams(cast, {frame}, kSeamVoxel_m);
    EXPECT_DOUBLE_EQ(scores.beside_objects.share.value.value(), static_cast<double>(width) / border)
        << width;
    const double gap_m2 = wall.Area_m2(kFirstOfObject - width - 0.5, kFirstOfObject - 0.5);
    EXPECT_NEAR(scores.beside_objects.area_m2, gap_m2, kAreaTolerance * gap_m2) << width;
    const double all_m2 = wall.Area_m2(first - 0.5, kFirstOfObject - 0.5);
    EXPECT_NEAR(scores.beside_objects.asked_area_m2, all_m2, kAreaTolerance * all_m2);
    EXPECT_EQ(cv::countNonZero(scores.seams), width * kSeamCamera.height);
  }
  // What is missing elsewhere, or of the object, is no seam.
  const cv::Mat elsewhere =
      Columns(Columns(frame.depth, 0, first - 1, 0.0), kFirstOfObject, kSeamCamera.width - 1, 0.0);
  EXPECT_EQ(ScoreSeams(elsewhere, {frame}, kSeamVoxel_m).beside_objects.share.value, 0.0);
}

TEST(SeamsOfDepth, BeginAVoxelBehindAndNotInFront) {
  const Frame frame = WallOf{}.Seen();
  const auto share = [&](double voxels) {
    const cv::Mat cast = frame.depth + voxels * kSeamVoxel_m;
    return ScoreSeams(cast, {frame}, kSeamVoxel_m).beside_objects.share.value.value();
  };
  EXPECT_EQ(share(0.9), 0.0);
  EXPECT_EQ(share(1.1), 1.0);
  EXPECT_EQ(share(-5), 0.0);
  const auto in_front = [&](double voxels) {
    const cv::Mat cast = frame.depth + voxels * kSeamVoxel_m;
    return ScoreSeams(cast, {frame}, kSeamVoxel_m).beside_objects.in_front.value.value();
  };
  EXPECT_EQ(in_front(-0.9), 0.0);
  EXPECT_EQ(in_front(-1.1), 1.0);
  EXPECT_EQ(in_front(5), 0.0);
}

// One column of the border's bulges, another is missing, and what bulges elsewhere does not count.
TEST(SeamsOfDepth, AreNotWhatBulges) {
  const WallOf wall;
  const Frame frame = wall.Seen();
  const int border = wall.BorderColumns();
  cv::Mat cast = Columns(frame.depth, kFirstOfObject - 1, kFirstOfObject - 1, 0.5);
  cast = Columns(cast, kFirstOfObject - 2, kFirstOfObject - 2, 0.0);
  cast = Columns(cast, 0, kFirstOfObject - border - 1, 0.5);
  const SeamScore score = ScoreSeams(cast, {frame}, kSeamVoxel_m).beside_objects;
  EXPECT_DOUBLE_EQ(score.in_front.value.value(), 1.0 / border);
  EXPECT_DOUBLE_EQ(score.share.value.value(), 1.0 / border);
}

TEST(SeamsOfDepth, AreAskedOfWhatEachFrameSaw) {
  const Frame frame = WallOf{}.Seen();
  const cv::Mat nothing = cv::Mat::zeros(frame.depth.size(), CV_32FC1);
  const SeamScores all = ScoreSeams(nothing, {frame}, kSeamVoxel_m);
  EXPECT_EQ(all.beside_objects.share.value, 1.0);
  Frame before = frame;
  before.mask = frame.mask.clone();
  before.mask.rowRange(0, 30).setTo(cv::Scalar(kStandsThere));
  const SeamScores some = ScoreSeams(nothing, {before, frame}, kSeamVoxel_m);
  EXPECT_EQ(some.beside_objects.share.value, 1.0);
  EXPECT_EQ(cv::countNonZero(some.seams), cv::countNonZero(all.seams) * 3 / 4);
  before.mask.setTo(cv::Scalar(kStandsThere));
  const SeamScores none = ScoreSeams(nothing, {before, frame}, kSeamVoxel_m);
  EXPECT_FALSE(none.beside_objects.share.value.has_value());
  EXPECT_FALSE(none.beside_objects.share.why_not.empty());
  EXPECT_EQ(none.beside_objects.area_m2, 0);
}

// The wall beside an object that stands far in front of it: the normal is not taken across.
TEST(SeamsOfDepth, BehindAnObjectHaveTheirOwnSlope) {
  const WallOf wall{0.8, 0.7};
  Frame frame = wall.Seen();
  frame.depth.colRange(kFirstOfObject, kSeamCamera.width).setTo(cv::Scalar(0.4));
  const cv::Mat nothing = cv::Mat::zeros(frame.depth.size(), CV_32FC1);
  const SeamScores scores = ScoreSeams(nothing, {frame}, kSeamVoxel_m);
  const int columns = cv::countNonZero(scores.seams) / kSeamCamera.height;
  // The nearer side's radius: 1.5 * 140 * 0.01 / 0.4 = 5.25.
  EXPECT_EQ(columns, 6);
  const double gap_m2 = wall.Area_m2(kFirstOfObject - columns - 0.5, kFirstOfObject - 0.5);
  EXPECT_NEAR(scores.beside_objects.area_m2, gap_m2, kAreaTolerance * gap_m2);
}

// A step in the background has a border of its own.
TEST(SeamsOfDepth, AtTheBackgroundsEdgesAreToldApart) {
  Frame frame = WallOf{}.Seen();
  constexpr int kStep = 20;
  frame.depth.colRange(0, kStep).setTo(cv::Scalar(2.0));
  const cv::Mat cast = Columns(frame.depth, kStep, kStep, 0.0);
  const SeamScores scores = ScoreSeams(cast, {frame}, kSeamVoxel_m);
  EXPECT_EQ(scores.beside_objects.share.value, 0.0);
  EXPECT_GT(scores.elsewhere.share.value.value(), 0.0);
  const double gap_m2 = WallOf{}.Area_m2(kStep - 0.5, kStep + 0.5);
  EXPECT_NEAR(scores.elsewhere.area_m2, gap_m2, kAreaTolerance * gap_m2);
}

// Steeper than a sample may be seen: 1 / sqrt(1 + 4^2) is the cosine of 76 degrees in the middle.
TEST(SeamsOfDepth, AreNotAskedAtGrazingIncidence) {
  Frame frame = WallOf{0.8, 4}.Seen();
  for (int u = 0; u < kSeamCamera.width; ++u) {
    const double z = WallOf{0.8, 4}.DepthAt(u);
    frame.depth.col(u).setTo(cv::Scalar(z > 0 ? z : 0));
  }
  const Frame level = WallOf{}.Seen();
  const cv::Mat nothing = cv::Mat::zeros(frame.depth.size(), CV_32FC1);
  const SeamScores scores = ScoreSeams(nothing, {frame}, kSeamVoxel_m);
  for (int u = 0; u < kSeamCamera.width; ++u) {
    if (scores.seams.at<std::uint8_t>(60, u) == 0) continue;
    const double slope_of_ray = (u - kSeamCamera.cx) / kSeamCamera.fx;
    const double cosine = std::abs(1 - 4 * slope_of_ray) /
                          (std::sqrt(17.0) * std::hypot(1, slope_of_ray, 0.5 / kSeamCamera.fy));
    EXPECT_GT(cosine, LeastSeenCosine() - 1e-3) << u;
  }
  EXPECT_GT(cv::countNonZero(ScoreSeams(nothing, {level}, kSeamVoxel_m).seams), 0);
}

// An area of 0 would be the best there is; where nothing stands, nothing was asked.
TEST(SeamsOfDepth, HaveNoAreaWhereNothingWasAsked) {
  Frame frame = WallOf{}.Seen();
  frame.mask.setTo(cv::Scalar(kBackground));
  Evaluation evaluation;
  evaluation.seams = ScoreSeams(frame.depth, {frame}, kSeamVoxel_m);
  const std::string why = evaluation.seams.beside_objects.share.why_not;
  EXPECT_EQ(why, "no mapped background beside an edge");
  int columns = 0;
  for (const EvaluationColumn& column : EvaluationColumns()) {
    if (column.csv != "seam_area_cm2") continue;
    ++columns;
    EXPECT_FALSE(column.value({}, evaluation).value);
    EXPECT_EQ(column.value({}, evaluation).why_not, why);
  }
  EXPECT_EQ(columns, 1);
  const nlohmann::json area = ToJson(evaluation)["seams"]["beside_objects"]["area_cm2"];
  EXPECT_EQ(area, ToJson(Measured::Undefined(why)));
}

// A slab under a brick, as a map would show it: without what lies within a gap around the brick.
TEST(SeamsOfDepth, OfATablesRingAreItsArea) {
  reference::Scene scene;
  scene.shapes.push_back(reference::Plane(kBackground, {150, 110, 70}, 0));
  scene.shapes.push_back(reference::Cuboid(
      kStandsThere, {200, 30, 30}, reference::MakePose(0, Eigen::Vector3d::UnitZ(), {0, 0, 0.05}),
      {0.06, 0.06, 0.05}));
  const Intrinsics camera{640, 480, 560.0, 560.0, 319.5, 239.5};
  // Almost from above, so that all of the ring is seen.
  const Pose T_WC = reference::LookAt({0.01, 0, 0.8}, {0, 0, 0});
  const Frame frame = reference::Render(scene, T_WC, 1, camera);
  constexpr double kGap_m = 0.008;
  cv::Mat cast = frame.depth.clone();
  for (int v = 0; v < camera.height; ++v) {
    for (int u = 0; u < camera.width; ++u) {
      if (frame.mask.at<std::uint16_t>(v, u) != kBackground) continue;
      const Eigen::Vector3d ray_C((u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, 1);
      const Eigen::Vector3d p_W = T_WC * (double{frame.depth.at<float>(v, u)} * ray_C);
      if (p_W.head<2>().cwiseAbs().maxCoeff() < 0.068 + kGap_m) cast.at<float>(v, u) = 0;
    }
  }
  const SeamScores scores = ScoreSeams(cast, {frame}, kSeamVoxel_m);
  // What the brick hides of the square from there: its top's shadow on the table.
  const double shadow = 0.06 * 0.8 / (0.8 - 0.1);
  const double side = 2 * (0.068 + kGap_m);
  const double ring_m2 = side * side - 4 * shadow * shadow;
  // Whole pixels along the square's outline, 1.4 mm wide, half of them at most.
  const double outline_m2 = 4 * side * 0.8 / 560 / 2;
  EXPECT_NEAR(scores.beside_objects.area_m2, ring_m2, outline_m2);
  EXPECT_LT(outline_m2, ring_m2 / 8);
}

}  // namespace
}  // namespace tsdfpp
