#include "mapper/segment/depth_segments.h"

#include <tbb/global_control.h>

#include <algorithm>

#include "tests/mapper/segment_scenes.h"

namespace tsdfpp {
namespace {

using test::BestFor;
using test::Block;
using test::ExactConfig;
using test::IdsIn;
using test::Look;
using test::SegmentsOf;
using test::Table;

// Of an object's pixels and its segment's: edges are told to a pixel or two, of a contour of some
// 200 pixels around some 3000.
constexpr double kGood = 0.88;
// With noise an edge is where differences over six pixels show it.
constexpr double kGoodInNoise = 0.75;

TEST(DepthSegments, ABoxOnATableIsOneSegmentThoughItShowsThreeFaces) {
  const Frame frame = Look({Table(), Block(7, {0, 0, 0.08}, {0.08, 0.06, 0.08})});
  for (const DepthSegmentsConfig& config : {ExactConfig(), DepthSegmentsConfig{}}) {
    const cv::Mat ids = SegmentsOf(frame, config);
    const auto box = BestFor(7, frame.mask, ids);
    EXPECT_EQ(box.id, 1);
    EXPECT_GT(box.iou, kGood);
    const auto table = BestFor(kBackground, frame.mask, ids);
    EXPECT_EQ(table.id, kBackground);
    EXPECT_GT(table.iou, kGood);
    EXPECT_EQ(IdsIn(ids), (std::set<InstanceId>{kBackground, 1}));
  }
}

TEST(DepthSegments, TwoBoxesThatTouchAreTwoSegments) {
  // A low one against a tall one: they meet in a concave edge.
  const Frame frame = Look({Table(), Block(3, {-0.08, 0, 0.1}, {0.08, 0.08, 0.1}, 0),
                            Block(4, {0.08, -0.02, 0.04}, {0.08, 0.08, 0.04}, 0)},
                           {0.5, -0.7, 0.6});
  const cv::Mat ids = SegmentsOf(frame, ExactConfig());
  const auto tall = BestFor(3, frame.mask, ids);
  const auto low = BestFor(4, frame.mask, ids);
  EXPECT_GT(tall.iou, kGood);
  EXPECT_GT(low.iou, kGood);
  EXPECT_NE(tall.id, low.id);
}

TEST(DepthSegments, ASphereOnATableIsOneSegment) {
  const Frame frame = Look({Table(), reference::Sphere(5, {9, 9, 200}, {0, 0, 0.08}, 0.08)});
  for (const DepthSegmentsConfig& config : {ExactConfig(), DepthSegmentsConfig{}}) {
    const auto sphere = BestFor(5, frame.mask, SegmentsOf(frame, config));
    EXPECT_EQ(sphere.id, 1);
    EXPECT_GT(sphere.iou, kGood);
  }
}

// A plate parallel to a wall, seen head-on: nothing but steps of depth.
TEST(DepthSegments, AStepOfDepthPartsParallelFaces) {
  Frame frame = Look({Table()});
  frame.depth.setTo(1.5F);
  frame.depth(cv::Rect(100, 80, 60, 50)).setTo(1.4F);
  const cv::Mat ids = SegmentsOf(frame, ExactConfig());
  EXPECT_EQ(ids.at<InstanceId>(10, 10), kBackground);
  cv::Mat truth = cv::Mat::zeros(ids.size(), CV_16UC1);
  truth(cv::Rect(100, 80, 60, 50)).setTo(1);
  EXPECT_EQ(BestFor(1, truth, ids).iou, 1);
  // The same step below what a pixel's width and the noise let see is none.
  frame.depth(cv::Rect(100, 80, 60, 50)).setTo(1.499F);
  EXPECT_EQ(IdsIn(SegmentsOf(frame, ExactConfig())), (std::set<InstanceId>{kBackground}));
}

TEST(DepthSegments, HolesStayHolesAndNarrowOnesPartNothing) {
  Frame frame = Look({Table(), Block(7, {0, 0, 0.08}, {0.08, 0.06, 0.08})});
  const cv::Mat whole = SegmentsOf(frame);
  const auto id = BestFor(7, frame.mask, whole).id;
  // One in five rows and columns has no depth, and a window in the middle.
  const cv::Rect window(20, 20, 30, 30);
  for (int v = 0; v < frame.depth.rows; ++v) {
    for (int u = 0; u < frame.depth.cols; ++u) {
      if (u % 5 == 0 || v % 5 == 0 || window.contains({u, v})) frame.depth.at<float>(v, u) = 0;
    }
  }
  const cv::Mat ids = SegmentsOf(frame);
  int same = 0;
  int valid = 0;
  for (int v = 0; v < ids.rows; ++v) {
    for (int u = 0; u < ids.cols; ++u) {
      if (frame.depth.at<float>(v, u) == 0) {
        ASSERT_EQ(ids.at<InstanceId>(v, u), kNoInstance) << u << ' ' << v;
        continue;
      }
      ++valid;
      same += (ids.at<InstanceId>(v, u) == id) == (whole.at<InstanceId>(v, u) == id) ? 1 : 0;
    }
  }
  // Edges move by a pixel or two: some 400 of 49000.
  EXPECT_GT(same, 0.985 * valid);
}

TEST(DepthSegments, NoiseOfTheModelChangesLittle) {
  const Frame exact = Look({Table(), Block(7, {-0.1, 0, 0.08}, {0.08, 0.06, 0.08}),
                            reference::Sphere(5, {9, 9, 200}, {0.16, 0, 0.08}, 0.08)});
  for (const std::uint64_t seed : {1, 2, 3, 4, 5}) {
    const Frame frame = test::WithNoise(exact, seed);
    const cv::Mat ids = SegmentsOf(frame);
    const auto box = BestFor(7, frame.mask, ids);
    const auto sphere = BestFor(5, frame.mask, ids);
    const auto table = BestFor(kBackground, frame.mask, ids);
    EXPECT_GT(box.iou, kGoodInNoise) << seed;
    EXPECT_GT(sphere.iou, kGoodInNoise) << seed;
    EXPECT_NE(box.id, sphere.id) << seed;
    EXPECT_EQ(table.id, kBackground) << seed;
    EXPECT_GT(table.iou, 0.95) << seed;
    // Noise makes no segments of its own, but for a fragment at an edge.
    EXPECT_LE(IdsIn(ids).size(), 5U) << seed;
  }
}

TEST(DepthSegments, TheLargestSegmentIsTheFirst) {
  const Frame frame = Look({Table(), Block(7, {-0.15, 0, 0.04}, {0.05, 0.04, 0.04}),
                            Block(8, {0.15, 0, 0.09}, {0.09, 0.08, 0.09})});
  const cv::Mat ids = SegmentsOf(frame);
  EXPECT_EQ(BestFor(8, frame.mask, ids).id, 1);
  EXPECT_EQ(BestFor(7, frame.mask, ids).id, 2);
}

TEST(DepthSegments, AreTheSameForAnyNumberOfThreadsAndWhateverCameBefore) {
  const Frame frame =
      test::WithNoise(Look({Table(), Block(7, {0, 0, 0.08}, {0.08, 0.06, 0.08})}), 9);
  DepthSegments used;
  ASSERT_TRUE(used.Segment(Look({Table()})).has_value());
  const cv::Mat expected = SegmentsOf(frame);
  for (const std::size_t threads : {1, 2, 3}) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    const auto segments = used.Segment(frame);
    ASSERT_TRUE(segments.has_value());
    EXPECT_EQ(cv::countNonZero(segments->ids != expected), 0) << threads;
  }
}

TEST(DepthSegments, TakesWhateverACameraGives) {
  Frame frame = Look({Table()});
  frame.depth.setTo(0);
  EXPECT_EQ(IdsIn(SegmentsOf(frame)), (std::set<InstanceId>{kNoInstance}));
  const float inf = std::numeric_limits<float>::infinity();
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const std::array<float, 8> values{inf, -inf, nan, -1, 1e-45F, 100, 101, 1e-3F};
  for (std::size_t i = 0; i < frame.depth.total(); ++i) {
    frame.depth.ptr<float>()[i] = values[(i * 7 + i / 13) % values.size()];
  }
  const cv::Mat ids = SegmentsOf(frame);
  for (std::size_t i = 0; i < frame.depth.total(); ++i) {
    if (IsValidDepth(frame.depth.ptr<float>()[i])) continue;
    ASSERT_EQ(ids.ptr<InstanceId>()[i], kNoInstance);
  }
  Frame tiny;
  tiny.intrinsics = {2, 2, 2, 2, 0.5, 0.5};
  tiny.depth = cv::Mat(2, 2, CV_32FC1, cv::Scalar(1));
  EXPECT_EQ(SegmentsOf(tiny).size(), cv::Size(2, 2));
}

TEST(DepthSegments, RefusesAnImageOfAnotherSizeOrType) {
  Frame frame = Look({Table()});
  frame.depth = frame.depth(cv::Rect(0, 0, 10, 10)).clone();
  DepthSegments segmenter;
  const auto ids = segmenter.Segment(frame);
  ASSERT_FALSE(ids.has_value());
  EXPECT_EQ(ids.error().kind, ErrorKind::kData);
  EXPECT_EQ(ids.error().message.rfind("frame 1: ", 0), 0U) << ids.error().message;
}

// More than there are ids: each pixel is a surface of its own, and none is small.
TEST(DepthSegments, RefusesMoreSegmentsThanThereAreIds) {
  Frame frame;
  frame.index = 1;
  frame.intrinsics = {300, 300, 250, 250, 149.5, 149.5};
  frame.depth.create(300, 300, CV_32FC1);
  for (int v = 0; v < 300; ++v) {
    for (int u = 0; u < 300; ++u) {
      frame.depth.at<float>(v, u) = 1 + static_cast<float>((7 * u + 3 * v) % 10);
    }
  }
  DepthSegmentsConfig config = ExactConfig();
  config.min_share = 0;
  config.min_m2 = 0;
  const auto ids = DepthSegments(config).Segment(frame);
  ASSERT_FALSE(ids.has_value());
  EXPECT_EQ(ids.error().kind, ErrorKind::kData);
  EXPECT_NE(ids.error().message.find("segments, expected at most 65534"), std::string::npos)
      << ids.error().message;
}

TEST(DepthSegmentsConfig, RoundTripsThroughTomlAndValidatesItself) {
  DepthSegmentsConfig config;
  EXPECT_TRUE(config.Validate().has_value());
  config.noise = DepthNoise::kExact;
  config.noise_scale = 2;
  config.sigmas = 4;
  config.jump_px = 2.5;
  config.concave_deg = 20;
  config.gap_px = 1;
  config.min_share = 0.01;
  config.min_m2 = 0.002;
  config.plane_m2 = 0.5;
  const auto read = DepthSegmentsConfig::FromToml(config.ToToml(), "a file");
  ASSERT_TRUE(read.has_value()) << read.error().message;
  EXPECT_EQ(*read, config);
  for (const char* text : {"noise = \"d435\"", "noise_scale = 0.0", "sigmas = nan",
                           "jump_px = -1.0", "concave_deg = 90.0", "gap_px = 17", "min_share = 2.0",
                           "min_m2 = -1.0", "plane_m2 = 0.0", "unknown = 1"}) {
    const auto table = ParseToml(text, "a file");
    ASSERT_TRUE(table.has_value()) << text;
    const auto refused = DepthSegmentsConfig::FromToml(*table, "a file");
    ASSERT_FALSE(refused.has_value()) << text;
    EXPECT_EQ(refused.error().kind, ErrorKind::kUsage);
    EXPECT_NE(refused.error().message.find("a file"), std::string::npos);
  }
}

}  // namespace
}  // namespace tsdfpp
