// Shadow, flying pixels, drop-out, range and quantisation against closed forms and ray casting.
#include "sim/sensor/depth_faults.h"

#include <gtest/gtest.h>

#include "core/units.h"
#include "sim/render/incidence.h"
#include "sim/sensor/depth_noise.h"
#include "tests/sim/sensor_images.h"

namespace tsdfpp {
namespace {

constexpr std::uint64_t kFaultSeed = 23;

TEST(Incidence, IsExactOnPlanes) {
  const Intrinsics k = TestCamera(80, 60, 90);
  // Depth in single precision moves a tangent of 1 / 90 m by 1e-7 m.
  constexpr double kTolerance_rad = 1e-4;
  for (const Eigen::Vector3d& direction :
       {Eigen::Vector3d(0, 0, 1), Eigen::Vector3d(0.5, 0, 1), Eigen::Vector3d(-0.4, 0.9, 1),
        Eigen::Vector3d(0, 1, 0.8)}) {
    const Eigen::Vector3d normal = direction.normalized();
    const Frame frame = FrameOf(k, [&](int u, int v) { return PlaneDepth(k, normal, 1, u, v); });
    const cv::Mat angles = IncidenceAngles(frame.depth, k);
    for (int v = 0; v < k.height; ++v) {
      for (int u = 0; u < k.width; ++u) {
        const Eigen::Vector3d ray((u - k.cx) / k.fx, (v - k.cy) / k.fy, 1);
        if (!IsValidDepth(frame.depth.at<float>(v, u))) {
          EXPECT_EQ(angles.at<float>(v, u), 0);
          continue;
        }
        const double truth = std::acos(normal.dot(ray) / ray.norm());
        // Near 0 the arc cosine doubles the digits lost.
        EXPECT_NEAR(angles.at<float>(v, u), truth, truth < 0.05 ? 2e-3 : kTolerance_rad);
      }
    }
  }
}

TEST(Incidence, DoesNotSeeAStepAsASurface) {
  const Intrinsics k = TestCamera(80, 60, 90);
  const Frame frame = FrameOf(k, [](int u, int v) { return u + v < 70 ? 1.0 : 2.0; });
  const cv::Mat angles = IncidenceAngles(frame.depth, k);
  // At the image's border a pixel may have no neighbour on its own side.
  for (int v = 1; v < k.height - 1; ++v) {
    for (int u = 1; u < k.width - 1; ++u) {
      const Eigen::Vector3d ray((u - k.cx) / k.fx, (v - k.cy) / k.fy, 1);
      // The arc cosine near 0 has half the digits of single precision.
      EXPECT_NEAR(angles.at<float>(v, u), std::acos(1 / ray.norm()), 1e-3);
    }
  }
}

// A slab of 0.2 m in front of a wall: which wall points see the projector is a question of two
// intervals.
TEST(ProjectorShadow, OfASlabBeforeAWall) {
  const Intrinsics k = TestCamera(200, 4, 300);
  constexpr double kNear_m = 1.0;
  constexpr double kFar_m = 2.0;
  constexpr double kHalf_m = 0.1;
  const Frame frame = FrameOf(k, [&](int u, int) {
    return std::abs((u - k.cx) / k.fx * kNear_m) < kHalf_m ? kNear_m : kFar_m;
  });
  for (const double baseline : {0.05, 0.075, 0.15}) {
    const cv::Mat depth = CastProjectorShadow(frame.depth, k, baseline);
    int shadow = 0;
    for (int u = 0; u < k.width; ++u) {
      const double z = frame.depth.at<float>(0, u);
      const double x = (u - k.cx) / k.fx * z;
      // Where the line from the point to the projector crosses the slab's plane.
      const double crossing = x + (baseline - x) * (z - kNear_m) / z;
      const bool dark = z == kFar_m && std::abs(crossing) < kHalf_m;
      shadow += dark ? 1 : 0;
      // A pixel of the slab's image is 1 / 300 m wide.
      const bool near_border = std::abs(std::abs(crossing) - kHalf_m) < 2.0 / 300;
      if (!near_border) {
        EXPECT_EQ(depth.at<float>(2, u) == 0, dark) << u << " " << baseline;
      }
    }
    // The shadow's width is the difference of disparity, f b (1 / near - 1 / far), on the left.
    EXPECT_NEAR(shadow, 300 * baseline * 0.5, 1.5);
    int holes = 0;
    for (int u = 0; u < k.width; ++u) {
      holes += depth.at<float>(2, u) == 0 ? 1 : 0;
      if (u > k.width / 2) {
        EXPECT_NE(depth.at<float>(2, u), 0);
      }
    }
    EXPECT_NEAR(holes, shadow, 2);
  }
}

// The width of the shadow follows the height of the step, down to the slack.
TEST(ProjectorShadow, OfLowSteps) {
  const Intrinsics k = TestCamera(120, 3, 300);
  for (const double step_px : {0.5, 2.0, 3.0, 5.0}) {
    const double disparity = 300 * 0.075;
    const Frame frame =
        FrameOf(k, [&](int u, int) { return disparity / (u < 60 ? 22.5 - step_px : 22.5); });
    const cv::Mat depth = CastProjectorShadow(frame.depth, k, 0.075);
    const int holes = depth.cols - cv::countNonZero(depth.row(1));
    if (step_px < kShadowSlack_px) {
      EXPECT_EQ(holes, 0);
    } else {
      // One more or less by the rounding to the projector's columns.
      EXPECT_NEAR(holes, step_px, 1);
      EXPECT_EQ(depth.at<float>(1, 59), 0);
    }
  }
}

TEST(ProjectorShadow, SmoothSurfacesHaveNone) {
  const Intrinsics k = TestCamera(160, 60, 300);
  for (const double tilt : {0.0, -50.0, 50.0}) {
    const Eigen::Vector3d normal(std::sin(tilt * kDegree), 0.2, std::cos(tilt * kDegree));
    const Frame frame = FrameOf(k, [&](int u, int v) { return PlaneDepth(k, normal, 1, u, v); });
    EXPECT_TRUE(SameBytes(CastProjectorShadow(frame.depth, k, 0.075), frame.depth)) << tilt;
  }
}

TEST(ProjectorShadow, AThinPoleHidesNoMoreThanItself) {
  const Intrinsics k = TestCamera(300, 3, 300);
  const Frame frame = FrameOf(k, [](int u, int) { return u >= 200 && u < 204 ? 0.8 : 2.4; });
  const cv::Mat depth = CastProjectorShadow(frame.depth, k, 0.1);
  // 30 px (1 / 0.8 - 1 / 2.4) = 25 px to the left of the pole, four pixels wide.
  for (int u = 0; u < k.width; ++u) {
    const bool dark = u >= 175 && u < 179;
    const bool near_border = std::abs(u - 174.5) < 1.5 || std::abs(u - 178.5) < 1.5;
    if (!near_border) {
      EXPECT_EQ(depth.at<float>(1, u) == 0, dark) << u;
    }
  }
}

TEST(FlyingPixels, AreBetweenBothSidesAtTheirRate) {
  const Intrinsics k = TestCamera(60, 5000, 300);
  const Frame frame = FrameOf(k, [](int u, int) { return u < 30 ? 1.0 : 1.5; });
  constexpr double kRate = 0.3;
  const cv::Mat depth = MixFlyingPixels(frame.depth, kRate, 0.05, kFaultSeed, 3);
  for (const auto& [column, start, other] : {std::tuple{29, 1.0, 1.5}, std::tuple{30, 1.5, 1.0}}) {
    Moments mixing;
    for (int v = 0; v < k.height; ++v) {
      const double t = (depth.at<float>(v, column) - start) / (other - start);
      ASSERT_GE(t, 0);
      ASSERT_LT(t, 1);
      if (t > 0) mixing.Add(t);
    }
    ExpectShare(mixing.count, k.height, kRate);
    // Uniform in [0, 1).
    EXPECT_NEAR(mixing.Mean(), 0.5, kSigmas * 0.2887 / std::sqrt(mixing.count));
    EXPECT_NEAR(mixing.Variance(), 1.0 / 12, kSigmas * 0.0745 / std::sqrt(mixing.count));
  }
  for (int v = 0; v < k.height; ++v) {
    for (int u = 0; u < k.width; ++u) {
      if (u != 29 && u != 30) {
        EXPECT_EQ(depth.at<float>(v, u), frame.depth.at<float>(v, u));
      }
    }
  }
  EXPECT_TRUE(SameBytes(MixFlyingPixels(frame.depth, 1, 0.6, kFaultSeed, 3), frame.depth));
  EXPECT_TRUE(SameBytes(MixFlyingPixels(frame.depth, 0, 0.05, kFaultSeed, 3), frame.depth));
}

TEST(DropOut, RampProbability) {
  EXPECT_EQ(RampProbability(1, 1, 2), 0);
  EXPECT_EQ(RampProbability(1.25, 1, 2), 0.25);
  EXPECT_EQ(RampProbability(2, 1, 2), 1);
  EXPECT_EQ(RampProbability(1, 1, 1), 0);
  EXPECT_EQ(RampProbability(1.01, 1, 1), 1);
}

TEST(DropOut, ByIncidence) {
  const Intrinsics k = TestCamera(300, 300, 20000);
  DepthSensorConfig config;
  config.dropout_incidence_start_deg = 60;
  config.dropout_incidence_end_deg = 80;
  // The narrow view keeps the angle within 0.6 deg of the plane's tilt.
  for (const double tilt : {50.0, 65.0, 70.0, 75.0, 85.0}) {
    const Eigen::Vector3d normal(0, std::sin(tilt * kDegree), std::cos(tilt * kDegree));
    const Frame frame = FrameOf(
        k, [&](int u, int v) { return PlaneDepth(k, normal, 2 * std::cos(tilt * kDegree), u, v); });
    const cv::Mat depth = SenseDepth(config, kFaultSeed, frame).value();
    const double count = static_cast<double>(depth.total());
    const double probability = std::clamp((tilt - 60) / 20, 0.0, 1.0);
    // Over the image the angle's deviations cancel but for this.
    EXPECT_NEAR(1 - cv::countNonZero(depth) / count, probability,
                kSigmas * 0.5 / std::sqrt(count) + 1e-3)
        << tilt;
  }
}

TEST(DropOut, ByRangeAndBoth) {
  const Intrinsics k = TestCamera(300, 300, 20000);
  DepthSensorConfig config;
  config.dropout_range_start_m = 2;
  config.dropout_range_end_m = 6;
  const auto kept = [&](double z) {
    return cv::countNonZero(SenseDepth(config, kFaultSeed, WallFrame(k, z)).value());
  };
  const double count = 300 * 300;
  EXPECT_EQ(kept(2), count);
  ExpectShare(kept(3), count, 0.75);
  ExpectShare(kept(5), count, 0.25);
  EXPECT_EQ(kept(6), 0);
  // Both at once are independent.
  DepthSensorConfig both = config;
  both.dropout_incidence_start_deg = 40;
  both.dropout_incidence_end_deg = 60;
  cv::Mat wall(300, 300, CV_32FC1, cv::Scalar(3));
  const cv::Mat incidence(300, 300, CV_32FC1, cv::Scalar(45 * kDegree));
  ExpectShare(cv::countNonZero(DropOut(wall, wall, incidence, both, kFaultSeed, 1)), count,
              0.75 * 0.75);
}

TEST(DepthRange, LeavesWhatIsInside) {
  const Frame frame = FrameOf(TestCamera(50, 1, 10), [](int u, int) { return 0.1 * u; });
  const cv::Mat depth = CutRange(frame.depth, 0.45, 3.05);
  for (int u = 0; u < 50; ++u) {
    const bool inside = u >= 5 && u <= 30;
    EXPECT_EQ(depth.at<float>(0, u), inside ? frame.depth.at<float>(0, u) : 0.0F) << u;
  }
}

TEST(DepthUnit, RoundsToWholeUnits) {
  const Frame frame =
      FrameOf(TestCamera(500, 1, 10), [](int u, int) { return 0.5 + 0.000731 * u; });
  for (const double unit : {0.001, 0.0002, 0.01}) {
    const cv::Mat depth = QuantiseDepth(frame.depth, unit);
    for (int u = 0; u < 500; ++u) {
      const double z = frame.depth.at<float>(0, u);
      const double units = depth.at<float>(0, u) / unit;
      EXPECT_NEAR(units, std::round(units), 1e-3);
      EXPECT_LE(std::abs(depth.at<float>(0, u) - z), unit / 2 + 1e-7);
    }
    // Rounded again nothing changes.
    EXPECT_TRUE(SameBytes(QuantiseDepth(depth, unit), depth));
  }
}

}  // namespace
}  // namespace tsdfpp
