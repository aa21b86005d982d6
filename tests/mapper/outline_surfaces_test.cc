// Labels beside outlines by the surfaces on both sides: masks that bleed and that end too early,
// true ones, and the same by the plain reference.
#include "mapper/associate/outline_surfaces.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include "tests/mapper/segment_scenes.h"
#include "tests/reference/outline_reference.h"

namespace tsdfpp {
namespace {

using namespace test;

constexpr float kStep_m = 0.005F;  // half a voxel of 1 cm
constexpr int kOff_px = 3;         // how far a mask is off its object, within kOutlineReach_px

// A block and a ball on a table, in front of a wall.
Frame TwoThings() {
  return Look({Table(), Block(1, {-0.1, 0, 0.06}, {0.06, 0.05, 0.06}),
               reference::Sphere(2, {30, 30, 200}, {0.15, 0.05, 0.07}, 0.07),
               reference::Cuboid(kBackground, {90, 90, 90},
                                 reference::MakePose(0, Eigen::Vector3d::UnitZ(), {0, 0.9, 0.3}),
                                 {2, 0.05, 0.6})});
}

// The mask with `of` grown by so many pixels, or shrunk where that is below 0.
cv::Mat Grown(const cv::Mat& mask, InstanceId of, int pixels) {
  cv::Mat grown = mask.clone();
  const int reach = std::abs(pixels);
  for (int v = 0; v < mask.rows; ++v) {
    for (int u = 0; u < mask.cols; ++u) {
      bool is_beside = false;
      for (int y = std::max(0, v - reach); y <= std::min(mask.rows - 1, v + reach); ++y) {
        for (int x = std::max(0, u - reach); x <= std::min(mask.cols - 1, u + reach); ++x) {
          if ((y - v) * (y - v) + (x - u) * (x - u) > reach * reach) continue;
          is_beside = is_beside || (mask.at<InstanceId>(y, x) == of) == (pixels > 0);
        }
      }
      if (!is_beside) continue;
      if (pixels > 0) grown.at<InstanceId>(v, u) = of;
      if (pixels < 0 && mask.at<InstanceId>(v, u) == of) grown.at<InstanceId>(v, u) = kBackground;
    }
  }
  return grown;
}

int Differing(const cv::Mat& a, const cv::Mat& b) { return cv::countNonZero(a != b); }

OutlineLabels Found(const Frame& frame, const cv::Mat& labels) {
  SurfaceMapper mapper;
  return LabelsByOutline(mapper.Compute(frame.depth, frame.intrinsics, {}), frame.depth, labels,
                         kStep_m);
}

class OutlineLabelsOf : public testing::TestWithParam<bool> {
 protected:
  // With a Kinect's noise, or exact.
  static Frame Seen() { return GetParam() ? WithNoise(TwoThings(), 20261126) : TwoThings(); }
};
INSTANTIATE_TEST_SUITE_P(Depth, OutlineLabelsOf, testing::Bool(),
                         [](const auto& with) { return with.param ? "Noisy" : "Exact"; });

// Of the pixels that a mask takes from others, or leaves to them, so many stay wrong: those within
// the tolerance of both sides, where block and ball meet the table, and at the block's edges, where
// a face has too few points to be known.
constexpr double kMostThatStay = 0.35;

TEST_P(OutlineLabelsOf, MasksThatBleedAreCutBack) {
  const Frame frame = Seen();
  for (const InstanceId of : {InstanceId{1}, InstanceId{2}}) {
    SCOPED_TRACE(of);
    const cv::Mat wrong = Grown(frame.mask, of, kOff_px);
    const int before = Differing(wrong, frame.mask);
    ASSERT_GT(before, 200);
    const int after = Differing(Found(frame, wrong).labels, frame.mask);
    EXPECT_LT(after, kMostThatStay * before) << "of " << before;
  }
}

TEST_P(OutlineLabelsOf, MasksThatEndTooEarlyGrow) {
  const Frame frame = Seen();
  for (const InstanceId of : {InstanceId{1}, InstanceId{2}}) {
    SCOPED_TRACE(of);
    const cv::Mat wrong = Grown(frame.mask, of, -kOff_px);
    const int before = Differing(wrong, frame.mask);
    ASSERT_GT(before, 150);
    const int after = Differing(Found(frame, wrong).labels, frame.mask);
    EXPECT_LT(after, kMostThatStay * before) << "of " << before;
  }
}

// One pixel in a hundred of those beside true outlines is taken for another's.
TEST_P(OutlineLabelsOf, TrueMasksStay) {
  const Frame frame = Seen();
  const int beside = Differing(Grown(frame.mask, 1, kOutlineReach_px), frame.mask) +
                     Differing(Grown(frame.mask, 2, kOutlineReach_px), frame.mask);
  ASSERT_GT(beside, 500);
  // As many are inside.
  EXPECT_LE(Differing(Found(frame, frame.mask).labels, frame.mask), 2 * beside / 100);
}

TEST_P(OutlineLabelsOf, AreThoseOfTheReference) {
  constexpr double kRounding = 1.001;  // of single precision, where a decision is that near
  const Frame frame = Seen();
  const cv::Mat wrong = Grown(Grown(frame.mask, 1, kOff_px), 2, -kOff_px);
  SurfaceMapper mapper;
  const SurfaceMaps& maps = mapper.Compute(frame.depth, frame.intrinsics, {});
  const OutlineLabels found = LabelsByOutline(maps, frame.depth, wrong, kStep_m);
  const reference::OutlineReference plain(maps, frame.depth, wrong, kStep_m);
  int changed = 0;
  int doubtful = 0;
  for (int v = 0; v < wrong.rows; ++v) {
    for (int u = 0; u < wrong.cols; ++u) {
      const reference::OutlineVerdict verdict = plain.Of(v, u);
      if (verdict.margin < kRounding) continue;
      ASSERT_EQ(found.labels.at<InstanceId>(v, u), verdict.label) << u << ' ' << v;
      ASSERT_EQ(found.is_doubtful.at<std::uint8_t>(v, u) != 0, verdict.is_doubtful)
          << u << ' ' << v;
      changed += verdict.label == wrong.at<InstanceId>(v, u) ? 0 : 1;
      doubtful += verdict.is_doubtful ? 1 : 0;
    }
  }
  EXPECT_GT(changed, 300);
  EXPECT_GT(doubtful, 0);
}

TEST(OutlineLabels, AreTheSameForAnyNumberOfThreads) {
  const Frame frame = TwoThings();
  const cv::Mat wrong = Grown(frame.mask, 1, kOff_px);
  const OutlineLabels all = Found(frame, wrong);
  const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
  const OutlineLabels alone = Found(frame, wrong);
  EXPECT_EQ(Differing(all.labels, alone.labels), 0);
  EXPECT_EQ(Differing(all.is_doubtful, alone.is_doubtful), 0);
}

// Nothing to compare with: one label, no depth, no labels at all, an object of one pixel.
TEST(OutlineLabels, StayWhereThereIsNothingToSay) {
  Frame frame = TwoThings();
  const cv::Mat one(frame.mask.size(), CV_16UC1, cv::Scalar(5));
  EXPECT_EQ(Differing(Found(frame, one).labels, one), 0);
  const cv::Mat none(frame.mask.size(), CV_16UC1, cv::Scalar(kNoInstance));
  EXPECT_EQ(Differing(Found(frame, none).labels, none), 0);
  cv::Mat pixel(frame.mask.size(), CV_16UC1, cv::Scalar(kBackground));
  pixel.at<InstanceId>(100, 100) = 7;
  EXPECT_EQ(Differing(Found(frame, pixel).labels, pixel), 0);
  frame.depth.setTo(0);
  EXPECT_EQ(Differing(Found(frame, frame.mask).labels, frame.mask), 0);
}

}  // namespace
}  // namespace tsdfpp
