// Motion blur and rolling shutter against integrals over time and moving bars.
#include "sim/render/shutter.h"

#include <gtest/gtest.h>

#include <numeric>

#include "sim/render/linear_light.h"
#include "tests/sim/sensor_images.h"

namespace tsdfpp {
namespace {

constexpr double kRoundOff = 1e-12;

TEST(Shutter, TimesLieInTheMiddleOfSlices) {
  EXPECT_EQ(SubFrameTimes({}), std::vector<double>{0});
  const ShutterConfig config{.exposure_s = 0.01, .readout_s = 0.02, .sub_frames = 3};
  const std::vector<double> times = SubFrameTimes(config);
  ASSERT_EQ(times.size(), 3U);
  EXPECT_NEAR(times[0], -0.01, kRoundOff);
  EXPECT_NEAR(times[1], 0, kRoundOff);
  EXPECT_NEAR(times[2], 0.01, kRoundOff);
  EXPECT_NEAR(RowTime(config, 0, 10), -0.009, kRoundOff);
  EXPECT_NEAR(RowTime(config, 9, 10), 0.009, kRoundOff);
}

// The weight of a sub-frame is the share of a fine grid of the row's exposure in its slice.
TEST(Shutter, WeightsAreTheIntegralOverTime) {
  constexpr int kGrid = 20000;
  constexpr int kHeight = 12;
  for (const ShutterConfig& config :
       {ShutterConfig{0.01, 0, 5}, ShutterConfig{0.01, 0.02, 7}, ShutterConfig{0.03, 0.01, 16},
        ShutterConfig{1e-4, 0.02, 4}}) {
    const double span = config.exposure_s + config.readout_s;
    for (int row = 0; row < kHeight; ++row) {
      std::vector<double> expected(static_cast<std::size_t>(config.sub_frames), 0.0);
      for (int i = 0; i < kGrid; ++i) {
        const double time =
            RowTime(config, row, kHeight) + config.exposure_s * ((i + 0.5) / kGrid - 0.5);
        const auto slice = static_cast<std::size_t>((time / span + 0.5) * config.sub_frames);
        expected.at(slice) += 1.0 / kGrid;
      }
      const std::vector<double> weights = RowWeights(config, row, kHeight);
      for (std::size_t i = 0; i < expected.size(); ++i) {
        EXPECT_NEAR(weights[i], expected[i], 2.0 / kGrid);
      }
      EXPECT_NEAR(std::accumulate(weights.begin(), weights.end(), 0.0), 1, 1e-9);
    }
  }
}

TEST(Shutter, WithoutExposureARowIsOneSubFrame) {
  const ShutterConfig config{.exposure_s = 0, .readout_s = 0.02, .sub_frames = 4};
  for (int row = 0; row < 8; ++row) {
    EXPECT_EQ(RowSubFrame(config, row, 8), row / 2);
    std::vector<double> expected(4, 0.0);
    expected[static_cast<std::size_t>(row / 2)] = 1;
    EXPECT_EQ(RowWeights(config, row, 8), expected);
  }
}

TEST(Shutter, BlurIsTheMeanInLinearLight) {
  std::vector<cv::Mat> images;
  for (const int level : {0, 255}) {
    images.emplace_back(3, 4, CV_8UC3, cv::Scalar(level, 100, level / 5));
  }
  const cv::Mat blurred = BlurColour(images);
  // Half the light of white is level 188, not 128.
  const double fifth = LevelToLight()[51] / 2;
  EXPECT_EQ(blurred.at<cv::Vec3b>(1, 1),
            cv::Vec3b(188, 100, static_cast<std::uint8_t>(std::lround(LightToLevel(fifth)))));
  const ShutterConfig global{.exposure_s = 0.01, .readout_s = 0, .sub_frames = 2};
  EXPECT_TRUE(SameBytes(ExposeColour(global, images), blurred));
}

TEST(Shutter, RowsAreTheirWeightedMean) {
  const ShutterConfig config{.exposure_s = 0.013, .readout_s = 0.02, .sub_frames = 4};
  const int levels[] = {10, 250, 60, 190};
  std::vector<cv::Mat> images;
  for (const int level : levels) images.emplace_back(16, 3, CV_8UC3, cv::Scalar::all(level));
  const cv::Mat exposed = ExposeColour(config, images);
  for (int row = 0; row < 16; ++row) {
    const std::vector<double> weights = RowWeights(config, row, 16);
    double light = 0;
    for (std::size_t i = 0; i < 4; ++i) {
      light += weights[i] * LevelToLight()[static_cast<std::size_t>(levels[i])];
    }
    EXPECT_EQ(exposed.at<cv::Vec3b>(row, 1)[2], std::lround(LightToLevel(light))) << row;
  }
}

TEST(Shutter, WhatRestsStaysAsItIs) {
  const Frame toy = ToyFrame();
  const ShutterConfig config{.exposure_s = 0.013, .readout_s = 0.02, .sub_frames = 6};
  std::vector<Frame> sub_frames(6, toy);
  Frame frame = toy;
  ApplyShutter(config, sub_frames, frame);
  EXPECT_TRUE(SameBytes(frame.colour, toy.colour));
  EXPECT_TRUE(SameBytes(frame.depth, toy.depth));
  EXPECT_TRUE(SameBytes(frame.mask, toy.mask));
}

// A vertical bar that moves a column a sub-frame leans by the readout.
TEST(Shutter, RollingShutterLeansWhatMoves) {
  constexpr int kHeight = 40;
  constexpr int kSubFrames = 10;
  const ShutterConfig config{.exposure_s = 0, .readout_s = 0.03, .sub_frames = kSubFrames};
  std::vector<Frame> sub_frames;
  for (int i = 0; i < kSubFrames; ++i) {
    sub_frames.push_back(
        FrameOf(TestCamera(30, kHeight, 30), [&](int u, int) { return u == 5 + i ? 1.0 : 2.0; }));
    sub_frames.back().mask.col(5 + i).setTo(3);
    sub_frames.back().colour.setTo(cv::Scalar(0, 0, 0));
    sub_frames.back().colour.col(5 + i).setTo(cv::Scalar(9, 99, 199));
  }
  Frame frame = sub_frames[5];
  frame.T_WC.translation().x() = 4;
  ApplyShutter(config, sub_frames, frame);
  for (int v = 0; v < kHeight; ++v) {
    for (int u = 0; u < 30; ++u) {
      const bool bar = u == 5 + v / 4;
      EXPECT_EQ(frame.depth.at<float>(v, u), bar ? 1.0F : 2.0F);
      EXPECT_EQ(frame.mask.at<std::uint16_t>(v, u), bar ? 3 : 0);
      EXPECT_EQ(frame.colour.at<cv::Vec3b>(v, u), bar ? cv::Vec3b(9, 99, 199) : cv::Vec3b(0, 0, 0));
    }
  }
  EXPECT_EQ(frame.T_WC.translation().x(), 4);
}

}  // namespace
}  // namespace tsdfpp
