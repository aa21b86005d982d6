// What the verbs of the pipeline make of a frame where the answer came with it (paper III-B to
// III-D); that nobody else reads the frame's masks and poses.
#include <gtest/gtest.h>

#include <filesystem>
#include <regex>
#include <string>

#include "core/files.h"
#include "mapper/associate/given_ids.h"
#include "mapper/segment/given_masks.h"
#include "mapper/segment/no_masks.h"
#include "mapper/track/given_poses.h"
#include "mapper/track/pcl_icp.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;

Frame SmallFrame() {
  Frame frame;
  frame.intrinsics = {6, 4, 5, 5, 2.5, 1.5};
  frame.depth = cv::Mat(4, 6, CV_32FC1, cv::Scalar(1.0));
  frame.colour = cv::Mat(4, 6, CV_8UC3, cv::Scalar(9, 9, 9));
  frame.mask = cv::Mat(4, 6, CV_16UC1, cv::Scalar(0));
  frame.mask(cv::Rect(0, 0, 3, 4)) = 7;
  frame.T_WO = {{7, Pose(Eigen::Translation3d(1, 2, 3))}};
  return frame;
}

bool AreEqual(const cv::Mat& a, const cv::Mat& b) {
  return a.size() == b.size() && a.type() == b.type() && cv::countNonZero(a != b) == 0;
}

TEST(PipelineVerbs, GivenMasksAreTheMask) {
  const Frame frame = SmallFrame();
  const Segments segments = GivenMasks().Segment(frame).value();
  EXPECT_TRUE(AreEqual(segments.ids, frame.mask));
  EXPECT_TRUE(segments.classes.empty());
}

TEST(PipelineVerbs, GivenMasksHaveTheClassesOfTheirObjects) {
  GivenMasks masks({{0, "background", "room"}, {7, "car", "car"}, {8, "thing", ""}});
  const std::map<InstanceId, std::string> expected{{7, "car"}};
  EXPECT_EQ(masks.Segment(SmallFrame()).value().classes, expected);
}

TEST(PipelineVerbs, NoMasksAreBackground) {
  Frame frame = SmallFrame();
  frame.mask = cv::Mat();
  const cv::Mat segments = NoMasks().Segment(frame).value().ids;
  EXPECT_TRUE(AreEqual(segments, cv::Mat(4, 6, CV_16UC1, cv::Scalar(kBackground))));
}

TEST(PipelineVerbs, GivenIdsAreTheSegments) {
  const Frame frame = SmallFrame();
  const auto map = MakeMap(Method::kTsdfppAnchored, MapConfig());
  const AssociatedObjects association =
      GivenIds().Associate(frame, {frame.mask, {{7, "car"}}}, *map);
  EXPECT_TRUE(AreEqual(association.labels, frame.mask));
  EXPECT_EQ(association.classes.at(7), "car");
}

TEST(PipelineVerbs, GivenPosesStayWhereAFrameSaysNothing) {
  const Frame frame = SmallFrame();
  const auto map = MakeMap(Method::kTsdfppAnchored, MapConfig());
  const Pose elsewhere(Eigen::Translation3d(5, 5, 5));
  const TrackedPoses tracked =
      GivenPoses().Track(frame, frame.mask, *map, {{3, elsewhere}, {7, elsewhere}});
  EXPECT_TRUE(tracked.seen.empty());
  const ObjectPoses& after = tracked.T_WO;
  ASSERT_EQ(after.size(), 2U);
  EXPECT_EQ(after.at(3).matrix(), elsewhere.matrix());
  EXPECT_EQ(after.at(7).matrix(), frame.T_WO.at(7).matrix());
}

// What cannot be registered stays.
TEST(PipelineVerbs, IcpBeginsWhereAnObjectIsFirstSeen) {
  const Frame frame = SmallFrame();
  const auto map = MakeMap(Method::kTsdfppAnchored, MapConfig());
  PclIcp icp{IcpConfig()};
  const TrackedPoses first = icp.Track(frame, frame.mask, *map, {});
  ASSERT_EQ(first.T_WO.size(), 1U);
  EXPECT_EQ(first.T_WO.at(7).matrix(), Pose::Identity().matrix());
  EXPECT_EQ(first.seen.at(7), TrackStatus::kBegun);
  const Pose elsewhere(Eigen::Translation3d(5, 5, 5));
  const TrackedPoses lost = icp.Track(frame, frame.mask, *map, {{7, elsewhere}});
  EXPECT_EQ(lost.T_WO.at(7).matrix(), elsewhere.matrix()) << "it has no mesh to be registered to";
  EXPECT_EQ(lost.seen.at(7), TrackStatus::kStayed);
}

// Of the mapper's files; tests/eval/stripped_truth_test.cc shows that a map does not notice.
TEST(PipelineVerbs, AreTheOnlyReadersOfTheTruth) {
  const std::regex mask(R"(\bframe(\.|->)mask\b)");
  const std::regex pose(R"(\bframe(\.|->)T_WO\b)");
  std::string readers_of_masks;
  std::string readers_of_poses;
  const fs::path mapper = fs::path(TSDFPP_SOURCE_DIR) / "mapper";
  for (const auto& entry : fs::recursive_directory_iterator(mapper)) {
    if (!entry.is_regular_file()) continue;
    const std::string text = ReadFile(entry.path()).value();
    const std::string name = entry.path().lexically_relative(mapper).string() + ";";
    if (std::regex_search(text, mask)) readers_of_masks += name;
    if (std::regex_search(text, pose)) readers_of_poses += name;
  }
  EXPECT_EQ(readers_of_masks, "segment/given_masks.cc;");
  EXPECT_EQ(readers_of_poses, "track/given_poses.cc;");
}

}  // namespace
}  // namespace tsdfpp
