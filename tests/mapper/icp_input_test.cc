// What ICP is given: the points of a segment, and its settings.
#include <gtest/gtest.h>

#include <array>
#include <limits>

#include "mapper/track/icp_registration.h"
#include "mapper/track/segment_points.h"
#include "tests/reference/analytic_scene.h"

namespace tsdfpp {
namespace {

using Points = std::vector<Eigen::Vector3d>;

// A plane that fills an image, seen at a slant; the label is a rectangle.
class SegmentPointsTest : public ::testing::Test {
 protected:
  static constexpr InstanceId kId = 7;
  static constexpr double kFloat_m = 1e-6;  // depth is float: half a unit in the last place at 4 m
  SegmentPointsTest() {
    reference::Scene scene;
    scene.shapes = {reference::Plane(kBackground, {9, 9, 9}, 0.3)};
    frame_ = reference::Render(scene, reference::LookAt({1, 2, 3}, {0, 0.5, 0.3}));
    labels_ = cv::Mat(frame_.depth.size(), CV_16UC1, cv::Scalar(kBackground));
    labels_(rectangle_) = kId;
  }
  Points Segment() const {
    return SegmentPoints(frame_, PixelsByLabel(labels_, config_.mask_erosion_px).at(kId), config_);
  }

  const cv::Rect rectangle_{20, 10, 30, 20};
  Frame frame_;
  cv::Mat labels_;
  IcpConfig config_;
};

TEST_F(SegmentPointsTest, LieOnTheSurfaceWhereTheirPixelsAre) {
  config_.mask_erosion_px = 0;
  const Points points_W = Segment();
  ASSERT_EQ(points_W.size(), 600U);
  const Intrinsics& camera = frame_.intrinsics;
  for (std::size_t i = 0; i < points_W.size(); ++i) {
    EXPECT_NEAR(points_W[i].z(), 0.3, kFloat_m);
    const Eigen::Vector3d p_C = frame_.T_WC.inverse() * points_W[i];
    const int u = 20 + static_cast<int>(i) % 30;
    const int v = 10 + static_cast<int>(i) / 30;
    EXPECT_NEAR(camera.fx * p_C.x() / p_C.z() + camera.cx, u, 1e-6);
    EXPECT_NEAR(camera.fy * p_C.y() / p_C.z() + camera.cy, v, 1e-6);
  }
}

TEST_F(SegmentPointsTest, LeaveOutTheOutlineWhereDepthIsMixed) {
  for (int v = 0; v < frame_.depth.rows; ++v) {
    for (int u = 0; u < frame_.depth.cols; ++u) {
      const cv::Rect inner(22, 12, 26, 16);
      if (!inner.contains({u, v})) frame_.depth.at<float>(v, u) += 0.1F;
    }
  }
  const Points points_W = Segment();
  EXPECT_EQ(points_W.size(), 26U * 16U);
  for (const Eigen::Vector3d& p_W : points_W) EXPECT_NEAR(p_W.z(), 0.3, kFloat_m);
}

TEST_F(SegmentPointsTest, KeepPixelsAtTheImagesBorder) {
  labels_ = kId;
  config_.max_points = 1000000;
  EXPECT_EQ(Segment().size(), frame_.depth.total());
}

TEST_F(SegmentPointsTest, LeaveOutInvalidDepth) {
  for (const float invalid : {0.0F, -1.0F, 100.5F, std::numeric_limits<float>::infinity(),
                              std::numeric_limits<float>::quiet_NaN()}) {
    frame_.depth.at<float>(20, 30) = invalid;
    EXPECT_EQ(Segment().size(), 26U * 16U - 1) << invalid;
  }
}

TEST_F(SegmentPointsTest, AreThinnedEvenly) {
  config_.max_points = 100;
  config_.mask_erosion_px = 0;
  const Points points_W = Segment();
  ASSERT_EQ(points_W.size(), 100U);
  std::array<int, 4> quarters{};
  for (const Eigen::Vector3d& p_W : points_W) {
    const Eigen::Vector3d p_C = frame_.T_WC.inverse() * p_W;
    const double u = frame_.intrinsics.fx * p_C.x() / p_C.z() + frame_.intrinsics.cx;
    const double v = frame_.intrinsics.fy * p_C.y() / p_C.z() + frame_.intrinsics.cy;
    ++quarters[(u < 34.5 ? 0U : 1U) + (v < 19.5 ? 0U : 2U)];
  }
  for (const int count : quarters) EXPECT_NEAR(count, 25, 5);  // a row of 30 gives 5 each
  EXPECT_EQ(points_W, Segment());
}

TEST_F(SegmentPointsTest, AreNoneForALabelThatIsNotThere) {
  EXPECT_FALSE(PixelsByLabel(labels_, config_.mask_erosion_px).contains(8));
  EXPECT_TRUE(SegmentPoints(frame_, {}, config_).empty());
}

TEST(IcpConfig, SurvivesToml) {
  const IcpConfig config{2.5, 15, 0.04, 1, 4000, 60, 0.25, 8, 0.2};
  const auto read = IcpConfig::FromToml(config.ToToml(), "t.toml");
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(*read, config);
  EXPECT_EQ(*IcpConfig::FromToml(toml::table{}, "t.toml"), IcpConfig{});
}

TEST(IcpConfig, NamesWhatIsWrong) {
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"correspondence_voxels = 0.0", "'correspondence_voxels' is 0, expected 0.1 to 100"},
      {"max_iterations = 0", "'max_iterations' is 0, expected 1 to 1000"},
      {"settled_voxels = 2.0", "'settled_voxels' is 2, expected 1e-06 to 1"},
      {"mask_erosion_px = -1", "'mask_erosion_px' is -1, expected 0 to 50"},
      {"max_points = 9", "'max_points' is 9, expected 10 to 1000000"},
      {"min_points = 5", "'min_points' is 5, expected 6 to 1000000"},
      {"max_points = 10", "'min_points' is 50, expected at most 'max_points', which is 10"},
      {"min_inlier_share = 1.5", "'min_inlier_share' is 1.5, expected 0 to 1"},
      {"max_translation_voxels = -1", "'max_translation_voxels' is -1, expected 0 to 1000"},
      {"max_rotation_rad = 4.0", "'max_rotation_rad' is 4, expected 0 to 3.14"},
      {"mask_erosion_px = \"two\"", "mask_erosion_px"},
      {"erosion = 2", "erosion"}};
  for (const auto& [text, sentence] : cases) {
    SCOPED_TRACE(text);
    const auto table = ParseToml(text, "t.toml");
    ASSERT_TRUE(table);
    const auto config = IcpConfig::FromToml(*table, "t.toml");
    ASSERT_FALSE(config);
    EXPECT_EQ(config.error().kind, ErrorKind::kUsage);
    EXPECT_NE(config.error().message.find("t.toml"), std::string::npos) << config.error().message;
    EXPECT_NE(config.error().message.find(sentence), std::string::npos) << config.error().message;
  }
}

}  // namespace
}  // namespace tsdfpp
