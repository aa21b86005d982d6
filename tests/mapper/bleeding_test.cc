// Pixels with the depth of the other side of an outline: against the rule spelled out for each
// pixel, and against what was shifted on purpose.
#include "mapper/segment/bleeding.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <random>
#include <vector>

#include "core/types.h"
#include "mapper/pipeline.h"

namespace tsdfpp {
namespace {

constexpr float kStep_m = 0.02F;
constexpr float kBox_m = 1;
constexpr float kWall_m = 2;
constexpr InstanceId kBox = 3;

float UpperMedian(std::vector<float> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

// The rule, pixel by pixel: whether it lies beside a step, whether it bleeds, and whether it is far
// from its own side.
struct Verdict {
  bool is_beside_step = false;
  bool bleeds = false;
  bool is_stray = false;
};

Verdict VerdictOf(const cv::Mat& depth, const cv::Mat& ids, int v, int u) {
  const InstanceId id = ids.at<InstanceId>(v, u);
  if (id == kNoInstance || !IsValidDepth(depth.at<float>(v, u))) return {};
  std::vector<float> own;
  std::vector<float> others;
  for (int y = 0; y < depth.rows; ++y) {
    for (int x = 0; x < depth.cols; ++x) {
      const bool is_near =
          std::max(std::abs(y - v), std::abs(x - u)) <= kBleedingReach_px && (y != v || x != u);
      if (!is_near || ids.at<InstanceId>(y, x) == kNoInstance) continue;
      if (!IsValidDepth(depth.at<float>(y, x))) continue;
      (ids.at<InstanceId>(y, x) == id ? own : others).push_back(depth.at<float>(y, x));
    }
  }
  if (own.empty() || others.empty()) return {};
  const float z = depth.at<float>(v, u);
  const bool is_stray = z - UpperMedian(own) > kStray_steps * kStep_m;
  if (std::abs(UpperMedian(own) - UpperMedian(others)) <= kStep_m) return {false, false, is_stray};
  return {true, std::abs(z - UpperMedian(others)) < std::abs(z - UpperMedian(own)), is_stray};
}

// Of the whole image: what waits.
cv::Mat Waiting(const cv::Mat& depth, const cv::Mat& ids) {
  cv::Mat waits(ids.size(), CV_8UC1, cv::Scalar(0));
  int beside_steps = 0;
  int bleeding = 0;
  for (int v = 0; v < ids.rows; ++v) {
    for (int u = 0; u < ids.cols; ++u) {
      const Verdict verdict = VerdictOf(depth, ids, v, u);
      beside_steps += verdict.is_beside_step ? 1 : 0;
      bleeding += verdict.bleeds ? 1 : 0;
      waits.at<std::uint8_t>(v, u) = verdict.bleeds || verdict.is_stray ? 255 : 0;
    }
  }
  if (bleeding == 0 || bleeding < kLeastBleedingShare * beside_steps) waits.setTo(0);
  return waits;
}

TEST(Bleeding, IsTheRuleOfEachPixel) {
  std::minstd_rand dice(7);
  const auto below = [&](int end) { return static_cast<int>(dice() % static_cast<unsigned>(end)); };
  int bleeding = 0;
  int taken_as_they_are = 0;
  for (int trial = 0; trial < 300; ++trial) {
    const cv::Size size(1 + below(40), 1 + below(30));
    cv::Mat ids(size, CV_16UC1, cv::Scalar(kBackground));
    cv::Mat depth(size, CV_32FC1, cv::Scalar(kWall_m));
    for (int i = 0; i < 6; ++i) {
      const cv::Rect box(below(size.width), below(size.height), 1 + below(12), 1 + below(12));
      const cv::Rect inside = box & cv::Rect({}, size);
      ids(inside) = i == 5 ? kNoInstance : 1 + i;
      depth(inside) = 1.0 + 0.015 * below(8);
    }
    // In some frames next to nothing is off.
    const int most_off = trial % 3 == 0 ? 3 : size.area() / 6;
    for (int i = 0; i < most_off; ++i) {
      const float values[] = {0,       std::numeric_limits<float>::quiet_NaN(),       -1, kBox_m,
                              kWall_m, 1.0F + 0.001F * static_cast<float>(below(300))};
      depth.at<float>(below(size.height), below(size.width)) = values[below(6)];
    }
    const cv::Mat rest = WithoutBleeding(depth, ids, kStep_m);
    const cv::Mat waiting = Waiting(depth, ids);
    bleeding += cv::countNonZero(waiting);
    taken_as_they_are += cv::countNonZero(waiting) == 0 ? 1 : 0;
    for (int v = 0; v < size.height; ++v) {
      for (int u = 0; u < size.width; ++u) {
        const bool waits = waiting.at<std::uint8_t>(v, u) != 0;
        const InstanceId expected = waits ? kNoInstance : ids.at<InstanceId>(v, u);
        ASSERT_EQ(rest.at<InstanceId>(v, u), expected) << trial << ": " << v << ", " << u;
      }
    }
  }
  EXPECT_GT(bleeding, 500);
  EXPECT_GT(taken_as_they_are, 5);
}

// A box before a wall.
struct View {
  cv::Mat depth{48, 64, CV_32FC1, cv::Scalar(kWall_m)};
  cv::Mat ids{48, 64, CV_16UC1, cv::Scalar(kBackground)};
  View() {
    const cv::Rect box(20, 12, 24, 20);
    depth(box) = kBox_m;
    ids(box) = kBox;
  }
};

TEST(Bleeding, TrueDepthStaysAsItIs) {
  const View view;
  const cv::Mat rest = WithoutBleeding(view.depth, view.ids, kStep_m);
  EXPECT_EQ(rest.data, view.ids.data);
}

// Where the wall has the box's depth, its median says nothing of a box's pixel that has the wall's.
TEST(Bleeding, StraysWaitWhereTheOtherSideBleedsToo) {
  View view;
  const cv::Rect above(20, 10, 24, 2);
  view.depth(above) = kBox_m;
  const cv::Point stray(32, 12);
  view.depth.at<float>(stray) = kWall_m;
  const cv::Mat rest = WithoutBleeding(view.depth, view.ids, kStep_m);
  EXPECT_EQ(rest.at<InstanceId>(stray), kNoInstance);
  EXPECT_EQ(rest.at<InstanceId>(stray + cv::Point(1, 0)), kBox);
  // What is nearer than its own side may be a thin thing's, of which the other pixels bleed.
  const cv::Point thin(32, 11);
  view.ids.at<InstanceId>(thin) = kBox;
  view.ids(cv::Rect(31, 10, 3, 1)) = kBox;
  view.depth(cv::Rect(30, 9, 5, 2)) = kWall_m;
  EXPECT_EQ(WithoutBleeding(view.depth, view.ids, kStep_m).at<InstanceId>(thin), kBox);
  // No camera bleeds at one pixel alone.
  View exact;
  exact.depth.at<float>(stray) = kWall_m;
  EXPECT_EQ(WithoutBleeding(exact.depth, exact.ids, kStep_m).data, exact.ids.data);
}

// At the box's corners the median of the few pixels inside may be one of the shifted ones.
constexpr double kMisjudged = 0.02;

// A third of the pixels have the depth of up to two pixels off: those to which that makes a
// difference are found, and no others.
TEST(Bleeding, WhatWasShiftedIsFound) {
  const View view;
  std::minstd_rand dice(3);
  int wrong = 0;
  int misjudged = 0;
  for (int trial = 0; trial < 50; ++trial) {
    cv::Mat shifted = view.depth.clone();
    for (int v = 2; v < shifted.rows - 2; ++v) {
      for (int u = 2; u < shifted.cols - 2; ++u) {
        const int dv = static_cast<int>(dice() % 5) - 2;
        const int du = static_cast<int>(dice() % 5) - 2;
        if (dice() % 3 == 0) shifted.at<float>(v, u) = view.depth.at<float>(v + dv, u + du);
      }
    }
    const cv::Mat is_wrong = shifted != view.depth;
    const cv::Mat rest = WithoutBleeding(shifted, view.ids, kStep_m);
    wrong += cv::countNonZero(is_wrong);
    misjudged += cv::countNonZero((rest == static_cast<double>(kNoInstance)) != is_wrong);
  }
  ASSERT_GT(wrong, 1000);
  EXPECT_LT(misjudged, kMisjudged * wrong);
}

// A pixel or two of the wrong depth are none of a camera that bleeds.
TEST(Bleeding, OfAFewPixelsNoneWaits) {
  View view;
  view.depth.at<float>(20, 21) = kWall_m;
  view.depth.at<float>(25, 43) = kWall_m;
  const cv::Mat rest = WithoutBleeding(view.depth, view.ids, kStep_m);
  EXPECT_EQ(rest.data, view.ids.data);
}

TEST(Bleeding, NothingOfOneIdAndNothingAtAll) {
  const cv::Mat one(1, 1, CV_16UC1, cv::Scalar(kBox));
  EXPECT_EQ(WithoutBleeding(cv::Mat(1, 1, CV_32FC1, cv::Scalar(1)), one, kStep_m).data, one.data);
  const cv::Mat unlabelled(9, 9, CV_16UC1, cv::Scalar(kNoInstance));
  const cv::Mat depth(9, 9, CV_32FC1, cv::Scalar(1));
  EXPECT_EQ(WithoutBleeding(depth, unlabelled, kStep_m).data, unlabelled.data);
}

// The pixel that bleeds is fused where it is kept and not where it waits; by itself it waits where
// something is tracked by signed distances.
TEST(Bleeding, WaitsInThePipeline) {
  View view;
  for (int u = 20; u < 44; u += 2) {
    for (const int v : {12, 31}) view.depth.at<float>(v, u) = kWall_m;
  }
  const cv::Point at(24, 12);
  Frame frame;
  frame.index = 1;
  frame.intrinsics = {64, 48, 60, 60, 31.5, 23.5};
  frame.depth = view.depth;
  frame.colour = cv::Mat(view.depth.size(), CV_8UC3, cv::Scalar::all(128));
  frame.mask = view.ids;
  frame.T_WO[kBox] = Pose::Identity();
  struct Case {
    BleedingPixels bleeding;
    PoseSource poses;
    CameraSource camera;
    bool waits;
  };
  for (const Case& of :
       {Case{BleedingPixels::kAuto, PoseSource::kGiven, CameraSource::kGiven, false},
        Case{BleedingPixels::kAuto, PoseSource::kIcp, CameraSource::kGiven, false},
        Case{BleedingPixels::kAuto, PoseSource::kTrack, CameraSource::kGiven, true},
        Case{BleedingPixels::kAuto, PoseSource::kGiven, CameraSource::kTrack, true},
        Case{BleedingPixels::kWait, PoseSource::kGiven, CameraSource::kGiven, true},
        Case{BleedingPixels::kKeep, PoseSource::kTrack, CameraSource::kTrack, false}}) {
    PipelineConfig config;
    config.bleeding = of.bleeding;
    config.poses = of.poses;
    config.camera = of.camera;
    EXPECT_EQ(config.BleedingWaits(), of.waits);
    Pipeline pipeline(config, {{kBackground, "background", ""}, {kBox, "box", ""}});
    const auto mapped = pipeline.Process(frame);
    ASSERT_TRUE(mapped) << mapped.error().message;
    EXPECT_EQ(pipeline.labels().at<InstanceId>(at), of.waits ? kNoInstance : kBox);
  }
}

TEST(Bleeding, NamesComeBack) {
  for (const BleedingPixels bleeding :
       {BleedingPixels::kAuto, BleedingPixels::kKeep, BleedingPixels::kWait}) {
    EXPECT_EQ(BleedingPixelsFromName(BleedingPixelsName(bleeding)).value(), bleeding);
  }
  const auto unknown = BleedingPixelsFromName("drop");
  ASSERT_FALSE(unknown);
  EXPECT_EQ(unknown.error().message, "bleeding 'drop' is unknown, expected auto, keep or wait");
}

}  // namespace
}  // namespace tsdfpp
