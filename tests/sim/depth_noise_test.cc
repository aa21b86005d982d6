// Depth models against their closed forms, and without noise against their formulae.
#include "sim/sensor/depth_noise.h"

#include <gtest/gtest.h>

#include <map>
#include <vector>

#include "core/units.h"
#include "sim/render/incidence.h"
#include "tests/sim/sensor_images.h"

namespace tsdfpp {
namespace {

constexpr std::uint64_t kDepthSeed = 17;
// Depth is stored in single precision.
constexpr double kFloat_m = 1e-6;

cv::Mat Sense(DepthModel model, const Frame& frame, double noise_scale = 1) {
  DepthSensorConfig config;
  config.model = model;
  config.noise_scale = noise_scale;
  const auto depth = SenseDepth(config, kDepthSeed, frame);
  EXPECT_TRUE(depth.has_value()) << depth.error().message;
  return depth.value();
}

Moments ErrorsOf(const cv::Mat& depth, const cv::Mat& truth) {
  Moments moments;
  for (int v = 0; v < depth.rows; ++v) {
    for (int u = 0; u < depth.cols; ++u) {
      moments.Add(static_cast<double>(depth.at<float>(v, u)) - truth.at<float>(v, u));
    }
  }
  return moments;
}

TEST(DepthNoise, ExactIsTheSameImage) {
  const Frame frame = ToyFrame();
  EXPECT_EQ(Sense(DepthModel::kExact, frame).data, frame.depth.data);
}

TEST(DepthNoise, D435GrowsWithTheSquareOfDepth) {
  const Intrinsics k = TestCamera(320, 240, 420);
  for (const double z : {0.5, 1.0, 2.0, 4.0}) {
    const Frame frame = WallFrame(k, z);
    // Intel's formula in millimetres: z^2 0.1 / (f 50).
    const double sigma = (1000 * z) * (1000 * z) * 0.1 / (420 * 50) / 1000;
    ExpectNormal(ErrorsOf(Sense(DepthModel::kD435, frame), frame.depth), 0, sigma);
    ExpectNormal(ErrorsOf(Sense(DepthModel::kD435, frame, 0.25), frame.depth), 0, sigma / 4);
  }
}

TEST(DepthNoise, AzureGrowsFromHalfAMetreOn) {
  const Intrinsics k = TestCamera(320, 240, 420);
  for (const auto& [z, sigma] : {std::pair{0.3, 0.0005}, std::pair{0.5, 0.0005},
                                 std::pair{1.5, 0.0015}, std::pair{3.0, 0.003}}) {
    const Frame frame = WallFrame(k, z);
    ExpectNormal(ErrorsOf(Sense(DepthModel::kAzure, frame), frame.depth), 0, sigma);
  }
}

// On a ramp of depth a shift in the image is an error of depth.
TEST(DepthNoise, AzureShiftsAQuarterOfAPixel) {
  const Intrinsics k = TestCamera(400, 200, 420);
  constexpr double kSlope_m = 0.004;
  const Frame frame = FrameOf(k, [](int u, int) { return 0.6 + kSlope_m * u; });
  const cv::Mat noisy = Sense(DepthModel::kAzure, frame);
  Moments normalised;
  for (int v = 0; v < k.height; ++v) {
    // Two pixels from the border six standard deviations of the shift stay inside.
    for (int u = 2; u < k.width - 2; ++u) {
      const double z = frame.depth.at<float>(v, u);
      const double sigma = std::hypot(0.0005 + 0.001 * (z - 0.5), 0.25 * kSlope_m);
      normalised.Add((noisy.at<float>(v, u) - z) / sigma);
    }
  }
  ExpectNormal(normalised, 0, 1);
}

TEST(DepthNoise, AzureHasNoDepthAtEdgesAndOnDarkSurfaces) {
  const Intrinsics k = TestCamera(60, 40, 420);
  Frame frame = FrameOf(k, [](int u, int) { return u < 30 ? 1.0 : 1.9; });
  frame.colour.rowRange(0, 5) = cv::Scalar(14, 14, 14);
  frame.colour.rowRange(5, 10) = cv::Scalar(15, 15, 15);
  // A grey of 0.587 * 25 = 14.7, and of 0.299 * 60 = 17.9.
  frame.colour.rowRange(10, 12) = cv::Scalar(0, 25, 0);
  frame.colour.rowRange(12, 14) = cv::Scalar(60, 0, 0);
  const cv::Mat depth = Sense(DepthModel::kAzure, frame, 0);
  for (int v = 0; v < k.height; ++v) {
    for (int u = 0; u < k.width; ++u) {
      const bool dark = v < 5 || (v >= 10 && v < 12);
      const bool edge = u == 29 || u == 30;
      EXPECT_EQ(depth.at<float>(v, u), dark || edge ? 0.0F : frame.depth.at<float>(v, u))
          << u << " " << v;
    }
  }
  // A lesser step is no edge.
  const Frame low = FrameOf(k, [](int u, int) { return u < 30 ? 1.0 : 1.79; });
  EXPECT_TRUE(SameBytes(Sense(DepthModel::kAzure, low, 0), low.depth));
}

TEST(DepthNoise, AzureNeedsColour) {
  Frame frame = ToyFrame(7);
  frame.colour = cv::Mat();
  DepthSensorConfig config;
  config.model = DepthModel::kAzure;
  const auto depth = SenseDepth(config, kDepthSeed, frame);
  ASSERT_FALSE(depth.has_value());
  EXPECT_EQ(depth.error().kind, ErrorKind::kUsage);
  EXPECT_EQ(
      depth.error().message,
      "the depth model 'azure' needs colour images (dark surfaces give no depth), and frame 7 "
      "has none");
}

// Numbers worked out from the formulae of the paper's table by hand.
TEST(DepthNoise, NguyenFormulae) {
  EXPECT_DOUBLE_EQ(NguyenLateralSigma_px(0), 0.8);
  EXPECT_NEAR(NguyenLateralSigma_px(45 * kDegree), 0.835, 1e-12);
  EXPECT_NEAR(NguyenLateralSigma_px(60 * kDegree), 0.87, 1e-12);
  EXPECT_DOUBLE_EQ(NguyenAxialSigma_m(0.4, 0), 0.0012);
  EXPECT_NEAR(NguyenAxialSigma_m(1.4, 0), 0.0031, 1e-12);
  EXPECT_NEAR(NguyenAxialSigma_m(1.4, 59.9 * kDegree), 0.0031, 1e-12);
  // 75 deg is 5 times what is left to 90 deg: 0.0001 / sqrt(4) * 25.
  EXPECT_NEAR(NguyenAxialSigma_m(4, 75 * kDegree), 0.0012 + 0.0019 * 3.6 * 3.6 + 0.00125, 1e-12);
  EXPECT_EQ(NguyenAxialSigma_m(2, 89.9 * kDegree), NguyenAxialSigma_m(2, 85 * kDegree));
  EXPECT_GT(NguyenAxialSigma_m(2, 84.9 * kDegree), NguyenAxialSigma_m(2, 84 * kDegree));
}

TEST(DepthNoise, NguyenOnAWall) {
  const Intrinsics k = TestCamera(320, 240, 420);
  for (const double z : {0.6, 1.5, 3.0}) {
    const Frame frame = WallFrame(k, z);
    ExpectNormal(ErrorsOf(Sense(DepthModel::kNguyen2012, frame), frame.depth), 0,
                 0.0012 + 0.0019 * (z - 0.4) * (z - 0.4));
  }
}

// On a slope the lateral noise moves the pixel by k columns with the probability that a normal
// number lies in [k - 1/2, k + 1/2].
TEST(DepthNoise, NguyenOnASlope) {
  const Intrinsics k = TestCamera(300, 200, 560);
  for (const double tilt : {40 * kDegree, 70 * kDegree}) {
    const Eigen::Vector3d normal(std::sin(tilt), 0, std::cos(tilt));
    const Frame frame = FrameOf(k, [&](int u, int v) { return PlaneDepth(k, normal, 0.8, u, v); });
    const cv::Mat noisy = Sense(DepthModel::kNguyen2012, frame);
    constexpr int kReach = 12;
    double ratio = 0;
    double count = 0;
    for (int v = 0; v < k.height; ++v) {
      for (int u = kReach; u < k.width - kReach; ++u) {
        const Eigen::Vector3d ray((u - k.cx) / k.fx, (v - k.cy) / k.fy, 1);
        const double incidence = std::acos(normal.dot(ray) / ray.norm());
        const double lateral = NguyenLateralSigma_px(incidence);
        const double z = PlaneDepth(k, normal, 0.8, u, v);
        double variance = 0;
        for (int step = -kReach; step <= kReach; ++step) {
          const double probability =
              NormalCdf((step + 0.5) / lateral) - NormalCdf((step - 0.5) / lateral);
          const double there = PlaneDepth(k, normal, 0.8, u + step, v);
          const double axial = NguyenAxialSigma_m(there, incidence);
          variance += probability * ((there - z) * (there - z) + axial * axial);
        }
        const double error = noisy.at<float>(v, u) - z;
        ratio += error * error / variance;
        ++count;
      }
    }
    // The square of a sum of a normal and a rounded normal number spreads no more than that of a
    // normal one, sqrt(2), by much; 3 bounds it.
    EXPECT_NEAR(ratio / count, 1, kSigmas * 3 / std::sqrt(count)) << tilt;
  }
}

// Levels and their probabilities: disparity n has depth `constant` / n / 100.
void ExpectLevels(const cv::Mat& depth, double constant_cm, double true_disparity, double sigma,
                  double bias) {
  std::map<int, int> seen;
  for (int v = 0; v < depth.rows; ++v) {
    for (int u = 0; u < depth.cols; ++u) {
      const double disparity = constant_cm / (100 * depth.at<float>(v, u));
      const int level = static_cast<int>(std::lround(disparity));
      // A level is a whole number, as far as a depth in single precision tells.
      ASSERT_NEAR(disparity, level, level * 1e-6);
      ++seen[level];
    }
  }
  const double count = static_cast<double>(depth.total());
  double expected_total = 0;
  for (int level = static_cast<int>(true_disparity) - 5; level < true_disparity + 6; ++level) {
    const double probability = NormalCdf((level + 0.5 - true_disparity - bias) / sigma) -
                               NormalCdf((level - 0.5 - true_disparity - bias) / sigma);
    ExpectShare(seen[level], count, probability);
    expected_total += probability;
  }
  EXPECT_NEAR(expected_total, 1, 1e-9);
}

TEST(DepthNoise, IclNuimLevels) {
  const Intrinsics k = TestCamera(320, 240, 480);
  for (const double z : {0.7, 1.234, 2.9}) {
    const Frame frame = WallFrame(k, z);
    ExpectLevels(Sense(DepthModel::kIclNuim, frame), 35130, 351.30 / frame.depth.at<float>(0, 0),
                 1.0 / 6, 0.5);
  }
}

TEST(DepthNoise, CoFusionLevels) {
  const Intrinsics k = TestCamera(320, 240, 480);
  for (const double z : {0.7, 1.234, 2.9}) {
    const Frame frame = WallFrame(k, z);
    ExpectLevels(Sense(DepthModel::kCoFusion, frame), 35130, 351.30 / frame.depth.at<float>(0, 0),
                 0.2, 0.5);
  }
}

TEST(DepthNoise, RedwoodLevels) {
  const Intrinsics k = TestCamera(320, 240, 480);
  for (const double z : {0.7, 1.234, 2.9}) {
    const Frame frame = WallFrame(k, z);
    ExpectLevels(Sense(DepthModel::kRedwood, frame), 3513 * 8,
                 35.130 * 8 / frame.depth.at<float>(0, 0), 0.027778 * 8, 0);
  }
}

// The share of pixels that take the depth from across a step, which lies between columns 59 and 60.
double ShareAcross(DepthModel model, int column) {
  const Intrinsics k = TestCamera(120, 4000, 480);
  const Frame frame = FrameOf(k, [](int u, int) { return u < 60 ? 1.0 : 2.0; });
  const cv::Mat depth = Sense(model, frame);
  int across = 0;
  for (int v = 0; v < k.height; ++v) across += depth.at<float>(v, column) > 1.5 ? 1 : 0;
  return across / 4000.0;
}

TEST(DepthNoise, LateralShiftsAcrossAStep) {
  constexpr double kCount = 4000;
  // Co-Fusion casts to whole pixels: a shift of one needs 2.5 standard deviations.
  ExpectShare(kCount * ShareAcross(DepthModel::kCoFusion, 59), kCount, 1 - NormalCdf(2.5));
  EXPECT_EQ(ShareAcross(DepthModel::kCoFusion, 57), 0);
  // Redwood takes the nearest pixel, then the even one: 59 and 58 share 58.
  ExpectShare(kCount * ShareAcross(DepthModel::kRedwood, 59), kCount, 1 - NormalCdf(0.5 / 0.25));
  ExpectShare(kCount * ShareAcross(DepthModel::kRedwood, 58), kCount, 1 - NormalCdf(1.5 / 0.25));
  // ICL-NUIM mixes both sides: beyond the middle where the shift is over half a pixel.
  ExpectShare(kCount * ShareAcross(DepthModel::kIclNuim, 59), kCount, 1 - NormalCdf(0.5 / 0.5));
  // Nguyen takes the nearest pixel; seen at 7 deg at most the lateral sigma is 0.80 px.
  ExpectShare(kCount * ShareAcross(DepthModel::kNguyen2012, 59), kCount, 1 - NormalCdf(0.5 / 0.8));
}

// A different depth in each pixel, from a formula.
Frame UnevenFrame() {
  return FrameOf(TestCamera(64, 48, 60), [](int u, int v) {
    return (u * 7 + v * 13) % 11 == 0 ? 0.0 : 0.5 + 0.03 * u + 0.171 * v;
  });
}

TEST(DepthNoise, WithoutNoiseOnlyTheQuantisationIsLeft) {
  const Frame frame = UnevenFrame();
  const cv::Mat icl = Sense(DepthModel::kIclNuim, frame, 0);
  const cv::Mat cofusion = Sense(DepthModel::kCoFusion, frame, 0);
  const cv::Mat redwood = Sense(DepthModel::kRedwood, frame, 0);
  EXPECT_TRUE(SameBytes(Sense(DepthModel::kD435, frame, 0), frame.depth));
  EXPECT_TRUE(SameBytes(Sense(DepthModel::kNguyen2012, frame, 0), frame.depth));
  for (int v = 0; v < frame.depth.rows; ++v) {
    for (int u = 0; u < frame.depth.cols; ++u) {
      const double z = frame.depth.at<float>(v, u);
      // Adding a half and rounding is rounding up.
      const double expected = z > 0 ? 351.30 / std::floor(35130 / (100 * z) + 1) : 0;
      EXPECT_NEAR(icl.at<float>(v, u), expected, kFloat_m * 10);
      EXPECT_EQ(cofusion.at<float>(v, u), icl.at<float>(v, u));
      const double even = frame.depth.at<float>(v / 2 * 2, u / 2 * 2);
      const double level = even > 0 && even < 10 ? std::floor(35.130 * 8 / even + 0.5) : 0;
      EXPECT_NEAR(redwood.at<float>(v, u), level > 0 ? 35.130 * 8 / level : 0, kFloat_m * 10);
    }
  }
}

TEST(DepthNoise, RedwoodEndsAtTenMetres) {
  const Intrinsics k = TestCamera(40, 30, 100);
  EXPECT_EQ(cv::countNonZero(Sense(DepthModel::kRedwood, WallFrame(k, 10.0))), 0);
  EXPECT_EQ(cv::countNonZero(Sense(DepthModel::kRedwood, WallFrame(k, 9.99))), 40 * 30);
}

TEST(DepthNoise, InvalidDepthStaysInvalid) {
  Frame frame = WallFrame(TestCamera(40, 30, 100), 1.5);
  const float bad[] = {0.0F, -1.0F, std::nanf(""), std::numeric_limits<float>::infinity(), 101.0F};
  for (int i = 0; i < 5; ++i) {
    // Far from each other, beyond the reach of any model's shift.
    frame.depth.at<float>(15, 4 + 8 * i) = bad[i];
  }
  for (const DepthModel model : {DepthModel::kD435, DepthModel::kAzure}) {
    const cv::Mat depth = Sense(model, frame, model == DepthModel::kAzure ? 0 : 1);
    for (int i = 0; i < 5; ++i) EXPECT_EQ(depth.at<float>(15, 4 + 8 * i), 0);
  }
  for (const std::string& name : DepthModelNames()) {
    DepthSensorConfig config;
    config.model = static_cast<DepthModel>(&name - DepthModelNames().data());
    config.max_range_m = 50;
    const cv::Mat depth = SenseDepth(config, kDepthSeed, frame).value();
    for (int v = 0; v < depth.rows; ++v) {
      for (int u = 0; u < depth.cols; ++u) {
        const float z = depth.at<float>(v, u);
        EXPECT_TRUE(z == 0 || IsValidDepth(z)) << name;
      }
    }
  }
}

TEST(DepthNoise, SimKinectQuantisesAWallAndHasHolesAtAStep) {
  const Intrinsics k = TestCamera(160, 120, 480);
  constexpr double kConstant = 480 * 0.075;
  const Frame wall = WallFrame(k, 1.5);
  const cv::Mat flat = Sense(DepthModel::kSimKinect, wall, 0);
  // 36 / 1.5 = 24 px is a whole step, so the second quantisation alone remains.
  const double expected = 351.30 / std::floor(351.30 / 1.5 + 1);
  for (int v = 8; v < k.height - 8; ++v) {
    for (int u = 8; u < k.width - 8; ++u) EXPECT_NEAR(flat.at<float>(v, u), expected, 1e-5);
  }
  EXPECT_LT(std::abs(kConstant / 1.5 - 24), 1e-12);
  // Holes grow with the height of the step and are near it.
  int last_holes = 0;
  for (const double far : {1.5, 1.9, 3.0}) {
    const Frame step = FrameOf(k, [&](int u, int) { return u < 80 ? 1.5 : far; });
    const cv::Mat depth = Sense(DepthModel::kSimKinect, step);
    int holes = 0;
    for (int v = 8; v < k.height - 8; ++v) {
      for (int u = 8; u < k.width - 8; ++u) {
        if (depth.at<float>(v, u) != 0) continue;
        ++holes;
        EXPECT_LT(std::abs(u - 79.5), 9);
      }
    }
    if (far > 1.5) {
      EXPECT_GT(holes, last_holes);
    }
    if (far == 1.5) {
      EXPECT_EQ(holes, 0);
    }
    last_holes = holes;
  }
}

TEST(DepthNoise, NoiseGrowsWithItsScale) {
  const Frame frame = ToyFrame();
  for (const DepthModel model : {DepthModel::kNguyen2012, DepthModel::kAzure, DepthModel::kD435}) {
    double last = 0;
    for (const double scale : {0.0, 0.5, 1.0, 2.0}) {
      const cv::Mat noisy = Sense(model, frame, scale);
      // The table alone: at edges the shifts of some models add jumps.
      const cv::Rect table(0, 100, 160, 20);
      const double error = ErrorsOf(noisy(table), frame.depth(table)).Variance();
      if (scale > 0) {
        EXPECT_GT(error, last);
      }
      last = error;
    }
  }
}

}  // namespace
}  // namespace tsdfpp
