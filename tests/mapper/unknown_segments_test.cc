// Association of segments that no network knows (Segments::unknown): they join the map's objects or
// are background, and never carry the background's surface into an object.
#include <gtest/gtest.h>

#include <numeric>
#include <opencv2/imgproc.hpp>

#include "core/pixel_ray.h"
#include "tests/mapper/toy_votes.h"
#include "tests/reference/votes_reference.h"

namespace tsdfpp {
namespace {

// The labels with the true ids that the map's were born as.
cv::Mat IdsOf(const VoteWorld& world, const cv::Mat& labels) {
  cv::Mat ids = labels.clone();
  for (const auto& [id, of] : world.truth_of()) {
    ids.setTo(static_cast<double>(of), labels == static_cast<double>(id));
  }
  return ids;
}

// Where the map's background has a surface that is nearer than that of the pixel's true object, by
// the reference's distances (255).
cv::Mat NearerToTheTable(const VoteWorld& world, const Frame& frame) {
  std::map<InstanceId, InstanceId> id_of;
  for (const auto& [id, of] : world.truth_of()) id_of[of] = id;
  cv::Mat nearer = cv::Mat::zeros(frame.mask.size(), CV_8UC1);
  for (int v = 0; v < nearer.rows; ++v) {
    for (int u = 0; u < nearer.cols; ++u) {
      const InstanceId of = frame.mask.at<InstanceId>(v, u);
      const float depth = frame.depth.at<float>(v, u);
      if (of == kBackground || !IsValidDepth(depth)) continue;
      const Eigen::Vector3d p_W =
          frame.T_WC * (static_cast<double>(depth) * PixelRay(frame.intrinsics, u, v));
      const double table = reference::DistanceTo(world.map(), kBackground, p_W);
      const double toy = reference::DistanceTo(world.map(), id_of[of], p_W);
      if (table >= 0 && (toy < 0 || table < toy)) nearer.at<std::uint8_t>(v, u) = 255;
    }
  }
  return nearer;
}

// Of what no network knows: it joins the map's objects, but for what is nearer to the table under
// them, and otherwise is background.
TEST(UnknownSegments, MakeNoObject) {
  const cv::Rect kTable(2, 58, 12, 8);
  // Of the toys' pixels. Those at their feet are 2.1 %: a voxel is 2 cm, a toy 3 to 11 high.
  constexpr double kMostLeftOut = 0.03;
  ToyVotes world;
  int of_toys = 0;
  int left_out = 0;
  for (int i = 0; i < 12; ++i) {
    const Frame frame = RenderToys(TableWithToys(), 0.3 + 0.05 * i, i);
    // Known ones at first, unknown ones later; beside them one of the table's, never known.
    cv::Mat segments = frame.mask.clone();
    segments(kTable) = 77;
    std::vector<InstanceId> unknown{77};
    if (i >= 6) unknown = {1, 2, 3, 77};
    const cv::Mat nearer = i < 6 ? cv::Mat() : NearerToTheTable(world, frame);
    const cv::Mat labels = world.Map(frame, {segments, {}, unknown});
    EXPECT_EQ(CountOf(labels(kTable), kBackground), kTable.area()) << i;
    if (i < 6) continue;
    cv::Mat expected = frame.mask.clone();
    expected.setTo(static_cast<double>(kNoInstance), (frame.mask != 0) & nearer);
    EXPECT_EQ(cv::countNonZero(IdsOf(world, labels) != expected), 0) << i;
    of_toys += cv::countNonZero(frame.mask);
    left_out += CountOf(labels, kNoInstance);
  }
  EXPECT_EQ(world.map().Objects(), (std::vector<InstanceId>{0, 1, 2, 3}));
  EXPECT_GT(left_out, 0);
  EXPECT_LE(left_out, kMostLeftOut * of_toys);
}

// Where depth is noisy and the view flat, what no network knows of the table is many small pieces.
// Those at a toy's foot are near it, too: were they the toy's, those beside them would be next.
TEST(UnknownSegments, OfTheTableStayTheBackgrounds) {
  constexpr int kSide_px = 7;
  constexpr int kFirstPiece = 10;
  // Of the table's pixels: a piece may lie under a toy's flank, where the map has both.
  constexpr double kMostLeftOut = 0.01;
  ToyVotes world;
  for (int i = 0; i < 20; ++i) {
    const Frame frame = RenderToys(TableWithToys(), 0.3 + 0.02 * i, i);
    cv::Mat segments = frame.mask.clone();
    const int in_a_row = segments.cols / kSide_px + 2;
    for (int v = 0; v < segments.rows; ++v) {
      for (int u = 0; u < segments.cols; ++u) {
        if (segments.at<InstanceId>(v, u) != kBackground) continue;
        // Others in each frame.
        const int piece =
            (v + i) / kSide_px * in_a_row + (u + 2 * i) % (kSide_px * in_a_row) / kSide_px;
        segments.at<InstanceId>(v, u) = static_cast<InstanceId>(kFirstPiece + piece);
      }
    }
    std::vector<InstanceId> unknown(static_cast<std::size_t>(in_a_row) * in_a_row);
    std::iota(unknown.begin(), unknown.end(), kFirstPiece);
    const cv::Mat labels = world.Map(frame, {segments, {}, unknown});
    const cv::Mat of_table = (frame.mask == 0) & (frame.depth > 0);
    const cv::Mat left_out = labels == static_cast<double>(kNoInstance);
    const cv::Mat taken = (labels != static_cast<double>(kBackground)) & ~left_out;
    EXPECT_EQ(cv::countNonZero(of_table & taken), 0) << i;
    EXPECT_LE(cv::countNonZero(of_table & left_out), kMostLeftOut * cv::countNonZero(of_table));
  }
  EXPECT_EQ(world.map().Objects(), (std::vector<InstanceId>{0, 1, 2, 3}));
}

// An object that was taken away is looked for around its place: it is not the table that was seen
// there before.
TEST(UnknownSegments, WhereAnObjectWasAreNotIt) {
  constexpr InstanceId kPiece = 77;
  ToyVotes world;
  cv::Mat place;
  for (int i = 0; i < 12; ++i) {
    const bool is_there = i >= 4 && i < 10;
    reference::Scene scene = TableOnly();
    if (is_there) AddBrick(scene, 0.3, {-0.14, 0.03, kTableTop_m + 0.045});
    const Frame frame = RenderToys(scene, 0.3 + 0.01 * i, i);
    cv::Mat segments = frame.mask.clone();
    std::vector<InstanceId> unknown;
    if (is_there) {
      place = frame.mask == static_cast<double>(kBrick);
    } else if (!place.empty()) {
      segments.setTo(static_cast<double>(kPiece), place);
      unknown = {kPiece};
    }
    const cv::Mat labels = world.Map(frame, {segments, {}, unknown});
    if (!unknown.empty()) {
      EXPECT_EQ(CountOf(labels, kBackground), labels.size().area()) << i;
    }
  }
  EXPECT_EQ(world.map().Objects(), (std::vector<InstanceId>{0, 1}));
}

// One segment of two toys, and of the table at their feet, which it is cut from as well.
TEST(UnknownSegments, OfTwoToysAreCutFromTheTableToo) {
  constexpr InstanceId kBoth = 77;
  constexpr int kAround_px = 2;
  constexpr double kMostTaken = 0.02;  // of the table's pixels: one where it meets a toy
  ToyVotes world;
  const auto frame_of = [](int index) {
    reference::Scene scene = TableOnly();
    AddBrick(scene, 0, {-0.06, 0, kTableTop_m + 0.045});
    AddBall(scene, {0.1, 0, kTableTop_m + 0.055});
    return RenderToys(scene, 0.3 + 0.02 * index, index);
  };
  int index = 0;
  for (; index < 6; ++index) world.Map(frame_of(index));
  const Frame frame = frame_of(index);
  constexpr int kSide_px = 2 * kAround_px + 1;
  cv::Mat around;
  cv::dilate(frame.mask != 0, around, cv::Mat::ones(kSide_px, kSide_px, CV_8UC1));
  cv::Mat segments(frame.mask.size(), CV_16UC1, cv::Scalar(0));
  segments.setTo(static_cast<double>(kBoth), around);
  const cv::Mat labels = world.Map(frame, {segments, {}, {kBoth}});
  const cv::Mat ids = IdsOf(world, labels);
  const cv::Mat of_table = (frame.mask == 0) & (segments != 0) & (frame.depth > 0);
  ASSERT_GT(cv::countNonZero(of_table), 100);
  EXPECT_LE(cv::countNonZero(of_table & (labels != static_cast<double>(kNoInstance))),
            kMostTaken * cv::countNonZero(of_table));
  for (const InstanceId toy : {kBrick, kBall}) {
    const int pixels = CountOf(frame.mask, toy);
    EXPECT_GT(cv::countNonZero((frame.mask == static_cast<double>(toy)) &
                               (ids == static_cast<double>(toy))),
              pixels * 9 / 10)
        << toy;
  }
}

// A network that finds a thing in every second frame: what waits to be an object is not fused
// between, nor do those frames count.
TEST(UnknownSegments, OfACandidateWaitWithIt) {
  ToyVotes world;
  for (int i = 0; i < 2 * kConfirmed - 1; ++i) {
    const Frame frame = RenderToys(TableWithToys(), 0.3, i);
    const std::vector<InstanceId> all{1, 2, 3};
    const cv::Mat labels =
        world.Map(frame, {frame.mask, {}, i % 2 == 0 ? std::vector<InstanceId>{} : all});
    const bool is_born = i == 2 * (kConfirmed - 1);
    EXPECT_EQ(CountOf(labels, kNoInstance), is_born ? 0 : cv::countNonZero(frame.mask)) << i;
  }
  EXPECT_EQ(world.map().Objects(), (std::vector<InstanceId>{0, 1, 2, 3}));
}

}  // namespace
}  // namespace tsdfpp
