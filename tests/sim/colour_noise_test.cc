// Colour against the formulae of sRGB, of the cosine law and of shot noise.
#include "sim/sensor/colour_noise.h"

#include <gtest/gtest.h>

#include "sim/render/linear_light.h"
#include "tests/sim/sensor_images.h"

namespace tsdfpp {
namespace {

constexpr std::uint64_t kColourSeed = 29;

Frame GreyFrame(int level, int width = 300, int height = 200) {
  Frame frame = WallFrame(TestCamera(width, height, 250), 1);
  frame.colour.setTo(cv::Scalar::all(level));
  return frame;
}

TEST(LinearLight, KnownValuesAndRoundTrip) {
  EXPECT_EQ(LevelToLight()[0], 0.0F);
  EXPECT_EQ(LevelToLight()[255], 1.0F);
  // Values of IEC 61966-2-1, rounded.
  EXPECT_NEAR(LevelToLight()[10], 0.0030353, 1e-7);
  EXPECT_NEAR(LevelToLight()[128], 0.2158605, 1e-7);
  EXPECT_NEAR(LightToLevel(0.5), 187.5160, 1e-3);
  for (int level = 0; level < 256; ++level) {
    const double light = LevelToLight()[static_cast<std::size_t>(level)];
    EXPECT_NEAR(LightToLevel(light), level, 1e-3);
  }
  EXPECT_EQ(LightToLevel(-1), 0);
  EXPECT_NEAR(LightToLevel(2), 255, 1e-12);
}

TEST(ColourNoise, ExactIsTheSameImage) {
  const Frame frame = ToyFrame();
  EXPECT_EQ(SenseColour({}, kColourSeed, frame).data, frame.colour.data);
  Frame none;
  EXPECT_TRUE(SenseColour({.noise_levels = 3}, kColourSeed, none).empty());
}

TEST(ColourNoise, AStopDoublesTheLight) {
  for (int level = 0; level < 256; level += 15) {
    const double light = LevelToLight()[static_cast<std::size_t>(level)];
    for (const double ev : {-2.0, -1.0, 1.0}) {
      const cv::Mat colour = SenseColour({.exposure_ev = ev}, kColourSeed, GreyFrame(level, 4, 4));
      const double expected = std::round(LightToLevel(std::min(1.0, light * std::pow(2, ev))));
      EXPECT_EQ(colour.at<cv::Vec3b>(1, 2)[1], expected) << level << " " << ev;
    }
  }
}

TEST(ColourNoise, ExposureJitterIsNormalFromFrameToFrame) {
  const ColourSensorConfig config{.exposure_ev = 0.5, .exposure_jitter_ev = 0.2};
  Moments moments;
  for (int frame = 1; frame <= 4000; ++frame)
    moments.Add(FrameExposure_ev(config, kColourSeed, frame));
  ExpectNormal(moments, 0.5, 0.2);
}

TEST(ColourNoise, VignettingIsTheCosineLaw) {
  const Frame frame = GreyFrame(200);
  const Intrinsics& k = frame.intrinsics;
  const cv::Mat full = SenseColour({.vignetting = 1}, kColourSeed, frame);
  const cv::Mat half = SenseColour({.vignetting = 0.5}, kColourSeed, frame);
  const double light = LevelToLight()[200];
  for (int v = 0; v < k.height; v += 7) {
    for (int u = 0; u < k.width; u += 7) {
      const double angle = std::atan(std::hypot((u - k.cx) / k.fx, (v - k.cy) / k.fy));
      const double gain = std::pow(std::cos(angle), 4);
      EXPECT_NEAR(full.at<cv::Vec3b>(v, u)[0], LightToLevel(light * gain), 0.5001);
      EXPECT_NEAR(half.at<cv::Vec3b>(v, u)[2], LightToLevel(light * (1 + gain) / 2), 0.5001);
    }
  }
  EXPECT_EQ(full.at<cv::Vec3b>(k.height / 2, k.width / 2)[0], 200);
}

TEST(ColourNoise, LevelNoise) {
  constexpr double kSigma = 4;
  const cv::Mat colour = SenseColour({.noise_levels = kSigma}, kColourSeed, GreyFrame(128));
  Moments channels[3];
  Moments products;
  for (int v = 0; v < colour.rows; ++v) {
    for (int u = 0; u < colour.cols; ++u) {
      const auto& rgb = colour.at<cv::Vec3b>(v, u);
      for (int c = 0; c < 3; ++c) channels[c].Add(rgb[c]);
      products.Add((rgb[0] - 128.0) * (rgb[1] - 128.0));
    }
  }
  // Rounding to whole levels adds a twelfth.
  for (const Moments& channel : channels) {
    ExpectNormal(channel, 128, std::sqrt(kSigma * kSigma + 1.0 / 12));
  }
  EXPECT_NEAR(products.Mean(), 0, kSigmas * kSigma * kSigma / std::sqrt(products.count));
}

TEST(ColourNoise, ShotNoiseGrowsWithTheLight) {
  constexpr double kElectrons = 20000;
  for (const int level : {60, 128, 220}) {
    const cv::Mat colour =
        SenseColour({.full_well_electrons = kElectrons}, kColourSeed, GreyFrame(level));
    Moments moments;
    for (int v = 0; v < colour.rows; ++v) {
      for (int u = 0; u < colour.cols; ++u) moments.Add(colour.at<cv::Vec3b>(v, u)[0]);
    }
    // Levels a unit of light at this level, times the deviation of the light, and rounding.
    const double light = LevelToLight()[static_cast<std::size_t>(level)];
    const double slope = (LightToLevel(light + 1e-5) - LightToLevel(light - 1e-5)) / 2e-5;
    const double variance = slope * slope * light / kElectrons + 1.0 / 12;
    // The curve of gamma over one standard deviation and the grid of levels, each below 2 %.
    constexpr double kCurve = 0.04;
    EXPECT_NEAR(moments.Variance() / variance, 1, kCurve + kSigmas * std::sqrt(2 / moments.count))
        << level;
    EXPECT_NEAR(moments.Mean(), level, 0.05);
  }
}

TEST(ColourNoise, BlackStaysBlackUnderShotNoise) {
  const cv::Mat colour =
      SenseColour({.full_well_electrons = 10}, kColourSeed, GreyFrame(0, 20, 20));
  EXPECT_EQ(cv::norm(colour, cv::NORM_INF), 0);
}

}  // namespace
}  // namespace tsdfpp
