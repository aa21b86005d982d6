#include "eval/score/segment_scores.h"

#include <gtest/gtest.h>

#include "bench/segment_shelf.h"
#include "tests/needs.h"

namespace tsdfpp {
namespace {

constexpr double kDouble = 1e-12;

cv::Mat Ids(const std::vector<std::vector<int>>& rows) {
  cv::Mat ids(static_cast<int>(rows.size()), static_cast<int>(rows.front().size()), CV_16UC1);
  for (int v = 0; v < ids.rows; ++v) {
    for (int u = 0; u < ids.cols; ++u) {
      ids.at<InstanceId>(v, u) =
          static_cast<InstanceId>(rows[static_cast<std::size_t>(v)][static_cast<std::size_t>(u)]);
    }
  }
  return ids;
}
cv::Mat Depth(cv::Size size) { return cv::Mat(size, CV_32FC1, cv::Scalar(1)); }

// Ten pixels a frame, counted by hand.
TEST(SegmentScores, AreThoseCountedByHand) {
  SegmentScorer scorer;
  // Background 4 of 5 right, IoU 4/5; object 3: 3 of 5, IoU 3/6 with segment 1, no match.
  const cv::Mat truth = Ids({{0, 0, 0, 0, 0, 3, 3, 3, 3, 3}});
  ASSERT_TRUE(scorer.Observe(truth, Ids({{0, 0, 0, 0, 1, 1, 1, 1, 2, 2}}), Depth(truth.size())));
  // Other ids in the next frame: background 5/5, object 3 by segment 9, 4/5, and one pixel of none.
  ASSERT_TRUE(
      scorer.Observe(truth, Ids({{0, 0, 0, 0, 0, 9, 9, 9, 9, kNoInstance}}), Depth(truth.size())));
  const SegmentScores scores = scorer.Result();
  EXPECT_EQ(scores.frames, 2);
  EXPECT_NEAR(*scores.mean_iou.value, ((0.8 + 0.5) / 2 + (1 + 0.8) / 2) / 2, kDouble);
  EXPECT_NEAR(*scores.background.pq.value, 0.9, kDouble);
  // One match of 0.8; false: the segments 1 and 2, and the object in the first frame.
  EXPECT_NEAR(*scores.objects.pq.value, 0.8 / (1 + 0.5 * 2 + 0.5 * 1), kDouble);
  EXPECT_NEAR(*scores.quality.pq.value, (1.8 + 0.8) / (3 + 0.5 * 2 + 0.5 * 1), kDouble);
  // Over time both segments of the first frame are object 3's: it has 5 + 4 pixels right, 1 wrong,
  // 1 lost.
  EXPECT_NEAR(scores.iou.at(3), 9.0 / 11, kDouble);
  EXPECT_NEAR(scores.iou.at(kBackground), 9.0 / 10, kDouble);
  EXPECT_NEAR(*scores.sequence_iou.value, (9.0 / 11 + 0.9) / 2, kDouble);
}

TEST(SegmentScores, BackgroundMatchesBackgroundOnly) {
  SegmentScorer scorer;
  const cv::Mat truth = Ids({{0, 0, 0, 0, 1, 1, 1, 1}});
  ASSERT_TRUE(scorer.Observe(truth, Ids({{5, 5, 5, 5, 0, 0, 0, 0}}), Depth(truth.size())));
  const SegmentScores scores = scorer.Result();
  EXPECT_EQ(*scores.quality.pq.value, 0);
  EXPECT_EQ(*scores.mean_iou.value, 0);
}

TEST(SegmentScores, LeaveOutWhatHasNoDepthAndWhatNobodyKnows) {
  SegmentScorer scorer;
  const cv::Mat truth = Ids({{0, 0, 1, 1, 1, kNoInstance, kNoInstance, kNoInstance}});
  cv::Mat depth = Depth(truth.size());
  depth.at<float>(0, 4) = 0;  // where the segment is wrong
  ASSERT_TRUE(scorer.Observe(truth, Ids({{0, 0, 4, 4, 0, 4, 7, 7}}), depth));
  const SegmentScores scores = scorer.Result();
  EXPECT_EQ(*scores.quality.pq.value, 1);
  EXPECT_EQ(*scores.mean_iou.value, 1);
  EXPECT_EQ(*scores.sequence_iou.value, 1);
}

TEST(SegmentScores, AreUndefinedWithoutFramesAndRefuseOtherSizes) {
  SegmentScorer scorer;
  EXPECT_FALSE(scorer.Result().mean_iou.value.has_value());
  EXPECT_FALSE(scorer.Observe(Ids({{0}}), Ids({{0, 0}}), Depth({1, 1})).has_value());
}

// The real shelf with 73 % of its depth missing: where things are labelled, depth alone beats the
// network's masks that came with it.
TEST(SegmentScores, DepthBeatsTheNetworkInTheBin) {
  TSDFPP_NEEDS_SHARED("apc_shelf_scene0000");
  const auto scores = ScoreShelf(test::SharedData("apc_shelf_scene0000"));
  ASSERT_TRUE(scores.has_value()) << scores.error().message;
  EXPECT_EQ(scores->depth.in_bin.frames, 15);
  EXPECT_GT(*scores->depth.in_bin.quality.pq.value, *scores->network.in_bin.quality.pq.value);
  EXPECT_GT(*scores->depth.in_bin.objects.pq.value, *scores->network.in_bin.objects.pq.value);
  EXPECT_GT(*scores->depth.in_bin.mean_iou.value, *scores->network.in_bin.mean_iou.value);
}

}  // namespace
}  // namespace tsdfpp
