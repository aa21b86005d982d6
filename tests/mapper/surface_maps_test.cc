#include "mapper/segment/surface_maps.h"

#include "tests/mapper/segment_scenes.h"
#include "tests/reference/surface_reference.h"

namespace tsdfpp {
namespace {

using test::Block;
using test::Look;
using test::Table;

// Decisions where float and double round to different sides of a limit: one pixel in ten thousand.
constexpr double kRounding = 1e-4;
// Of a unit vector: slopes are differences of float values over two pixels.
constexpr double kNormal = 2e-3;

Frame ThreeThings() {
  return Look({Table(), Block(7, {-0.1, 0, 0.08}, {0.08, 0.06, 0.08}),
               reference::Sphere(5, {9, 9, 200}, {0.16, 0, 0.08}, 0.08)});
}

Frame WithGaps(Frame frame) {
  for (int v = 0; v < frame.depth.rows; ++v) {
    for (int u = 0; u < frame.depth.cols; ++u) {
      if (u % 7 == 0 || v % 11 < 2 || (u / 40 + v / 40) % 5 == 0) frame.depth.at<float>(v, u) = 0;
    }
  }
  return frame;
}

void ExpectEqualToReference(const Frame& frame, const DepthSegmentsConfig& config) {
  SurfaceMapper mapper;
  const SurfaceMaps& maps = mapper.Compute(frame.depth, frame.intrinsics, config);
  reference::SurfaceSettings settings;
  settings.noise_scale = config.noise == DepthNoise::kExact ? 0 : config.noise_scale;
  settings.step_px = maps.reach.step_px;
  settings.smooth_px = maps.reach.smooth_px;
  const reference::SurfaceReference slow(frame.depth, frame.intrinsics, settings);
  const int rows = frame.depth.rows;
  const int cols = frame.depth.cols;
  int normals = 0;
  int jumps = 0;
  int concave = 0;
  int concave_in_all = 0;
  int jumps_in_all = 0;
  for (int v = 0; v < rows; ++v) {
    for (int u = 0; u < cols; ++u) {
      const float q = maps.inverse_depth.at<float>(v, u);
      ASSERT_EQ(q == 0, slow.Q(u, v) == 0) << u << ' ' << v;
      const auto& n = maps.normal.at<cv::Vec3f>(v, u);
      const Eigen::Vector3d normal(n[0], n[1], n[2]);
      if ((normal - slow.Normal(u, v)).norm() > kNormal) ++normals;
      if (u + 1 < cols) {
        const bool jump = slow.Jumps(u, v, 1, 0);
        jumps += (maps.reach_right.at<std::uint8_t>(v, u) == 0) != jump ? 1 : 0;
        jumps_in_all += jump ? 1 : 0;
      }
      if (v + 1 < rows) {
        const bool jump = slow.Jumps(u, v, 0, 1);
        jumps += (maps.reach_down.at<std::uint8_t>(v, u) == 0) != jump ? 1 : 0;
        jumps_in_all += jump ? 1 : 0;
      }
      const bool is_concave = q != 0 && slow.IsConcave(u, v);
      concave += (maps.concave.at<std::uint8_t>(v, u) != 0) != is_concave ? 1 : 0;
      concave_in_all += is_concave ? 1 : 0;
    }
  }
  const double few = kRounding * rows * cols;
  EXPECT_LE(normals, few);
  EXPECT_LE(jumps, few);
  EXPECT_LE(concave, few);
  // There is something to be found.
  EXPECT_GT(jumps_in_all, 200);
  EXPECT_GT(concave_in_all, 100);
}

DepthSegmentsConfig Kinect() { return {}; }

TEST(SurfaceMaps, EqualTheSlowOnesOnExactDepth) {
  ExpectEqualToReference(ThreeThings(), test::ExactConfig());
}
TEST(SurfaceMaps, EqualTheSlowOnesInNoise) {
  ExpectEqualToReference(test::WithNoise(ThreeThings(), 3), Kinect());
}
TEST(SurfaceMaps, EqualTheSlowOnesAcrossGaps) {
  ExpectEqualToReference(WithGaps(ThreeThings()), test::ExactConfig());
  ExpectEqualToReference(WithGaps(test::WithNoise(ThreeThings(), 4)), Kinect());
}

// Where noise is so loud that nearly any two values agree, too.
TEST(SurfaceMaps, NothingIsMadeUpInAHole) {
  constexpr int kWide_px = 3;
  Frame frame;
  frame.intrinsics = {160, 120, 140, 140, 79.5, 59.5};
  frame.depth = cv::Mat(120, 160, CV_32FC1, cv::Scalar(20));
  cv::Mat hole = frame.depth(cv::Rect(80, 0, kWide_px, 120));
  hole.setTo(0);
  DepthSegmentsConfig config;
  config.noise_scale = 10;
  ASSERT_GT(kWide_px, config.gap_px);
  SurfaceMapper mapper;
  const SurfaceMaps& maps = mapper.Compute(frame.depth, frame.intrinsics, config);
  EXPECT_EQ(cv::countNonZero(maps.inverse_depth), 120 * (160 - kWide_px));
}

TEST(SurfaceMaps, NormalsOfATableAreItsOwn) {
  const Eigen::Vector3d eye(0.1, -0.8, 0.7);
  const Frame frame = Look({Table()}, eye);
  const Eigen::Vector3d up_C = frame.T_WC.linear().transpose() * Eigen::Vector3d::UnitZ();
  const auto worst_deg = [&](const Frame& seen, const DepthSegmentsConfig& config) {
    SurfaceMapper mapper;
    const SurfaceMaps& maps = mapper.Compute(seen.depth, seen.intrinsics, config);
    std::vector<double> angles;
    for (int v = 10; v < seen.depth.rows - 10; ++v) {
      for (int u = 10; u < seen.depth.cols - 10; ++u) {
        if (seen.depth.at<float>(v, u) == 0) continue;
        const auto& n = maps.normal.at<cv::Vec3f>(v, u);
        const double cosine = Eigen::Vector3d(n[0], n[1], n[2]).dot(up_C);
        angles.push_back(std::acos(std::min(cosine, 1.0)) * 180 / std::numbers::pi);
      }
    }
    std::sort(angles.begin(), angles.end());
    return angles[angles.size() * 95 / 100];
  };
  // Rounding of depth to float, over two pixels.
  EXPECT_LT(worst_deg(frame, test::ExactConfig()), 0.1);
  // The reach is chosen so that noise bends a chord by less than its tangent of 0.25 (14 deg) at
  // three standard deviations, two of which are 95 % of the pixels.
  EXPECT_LT(worst_deg(test::WithNoise(frame, 5), Kinect()), 10);
}

// How many links follow each other, at most 255, counted one by one: of a wall with a step and
// holes that are too wide to be bridged, wider and higher than that.
TEST(SurfaceMaps, ReachIsTheNumberOfLinksAhead) {
  constexpr int kRows = 300;
  constexpr int kCols = 700;
  cv::Mat depth(kRows, kCols, CV_32FC1, cv::Scalar(2));
  depth.colRange(610, kCols).setTo(1.5);
  depth(cv::Rect(40, 280, 60, 15)).setTo(0);
  SurfaceMapper mapper;
  DepthSegmentsConfig config;
  config.noise = DepthNoise::kExact;
  const SurfaceMaps& maps =
      mapper.Compute(depth, {kCols, kRows, 600, 600, kCols / 2.0, kRows / 2.0}, config);
  const auto count = [&](const cv::Mat& reach, int v, int u, int down, int right) {
    int links = 0;
    while (links < 255 && v < kRows && u < kCols && reach.at<std::uint8_t>(v, u) != 0) {
      ++links;
      v += down;
      u += right;
    }
    return links;
  };
  int longest = 0;
  for (int v = 0; v < kRows; ++v) {
    for (int u = 0; u < kCols; ++u) {
      const int right = count(maps.reach_right, v, u, 0, 1);
      ASSERT_EQ(maps.reach_right.at<std::uint8_t>(v, u), right);
      ASSERT_EQ(maps.reach_down.at<std::uint8_t>(v, u), count(maps.reach_down, v, u, 1, 0));
      longest = std::max(longest, right);
    }
  }
  EXPECT_EQ(longest, 255);
  EXPECT_EQ(maps.reach_right.at<std::uint8_t>(10, 609), 0) << "the step";
}

TEST(ChordReach, GrowsWithNoiseInPixels) {
  const float pixel = 1.0F / 525;
  const auto reach = [&](float z, const DepthSegmentsConfig& config) {
    return ChooseReach(cv::Mat(48, 64, CV_32FC1, cv::Scalar(z)), pixel, config);
  };
  EXPECT_EQ(reach(1, test::ExactConfig()), (ChordReach{kLeastStep_px, 0}));
  EXPECT_EQ(reach(0, Kinect()), (ChordReach{kLeastStep_px, 0}));
  // 1.0 mm of a pixel's 1.9 mm: sqrt(sqrt 6 * 3 * 0.99 / 0.25) = 5.4.
  EXPECT_EQ(reach(1, Kinect()), (ChordReach{6, 2}));
  EXPECT_EQ(reach(2, Kinect()), (ChordReach{7, 3}));
  DepthSegmentsConfig loud;
  loud.noise_scale = 10;
  EXPECT_EQ(reach(2, loud), (ChordReach{kGreatestStep_px, (kGreatestStep_px - 1) / 2}));
}

}  // namespace
}  // namespace tsdfpp
