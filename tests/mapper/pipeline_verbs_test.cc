// What the verbs of the pipeline make of a frame where the answer came with it (paper III-B to
// III-D); that nobody else reads the frame's masks and poses.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <array>
#include <filesystem>
#include <map>
#include <regex>
#include <set>
#include <string>
#include <tuple>

#include "core/files.h"
#include "mapper/associate/given_ids.h"
#include "mapper/associate/object_lookup.h"
#include "mapper/pipeline.h"
#include "mapper/segment/given_masks.h"
#include "mapper/segment/no_masks.h"
#include "mapper/track/given_poses.h"
#include "mapper/track/pcl_icp.h"
#include "tests/mapper/toy_scene.h"

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

// Whatever is called mask or T_WO in the mapper's files and the command line's, and why it may be
// read there. What is no frame's member is not the truth.
const std::map<std::string, std::string>& AllowedReaders() {
  static const std::map<std::string, std::string> readers{
      {"mapper/segment/given_masks.cc frame.mask", "the verb whose answer it is"},
      {"mapper/track/given_poses.cc frame.T_WO", "the verb whose answer it is"},
      {"mapper/segment/instance_finder.cc instance.mask", "what a network found"},
      {"mapper/methods/object_volume_map.cc added.T_WO", "the map's own pose of an object"},
      {"mapper/methods/object_volume_map.cc volume.T_WO", "the map's own pose of an object"},
      {"mapper/methods/surfel_map.cc object.T_WO", "the map's own pose of an object"},
      {"mapper/store/volume_store.cc volume.T_WO", "the map's own pose of an object"},
      {"mapper/volume/object_volume.h volume.T_WO", "the map's own pose of an object"},
      {"mapper/volume/freeing.cc volume.T_WO", "whether the map has a pose of an object"},
      {"mapper/pipeline.cc tracked.T_WO", "what the tracker answered"},
      {"mapper/pipeline.cc frame.T_WO", "made rotations, for the verb that reads them"},
      {"mapper/track/lost_objects.cc found.T_WO", "where a lost object was found"},
      {"mapper/track/lost_objects.cc kept.T_WO", "where the map had a lost object"},
      {"mapper/track/camera_tracker.cc after.T_WO", "the tracker's answer"},
      {"mapper/track/given_poses.cc after.T_WO", "the tracker's answer"},
      {"mapper/track/pcl_icp.cc after.T_WO", "the tracker's answer"},
      {"mapper/track/sdf_tracker.cc after.T_WO", "the tracker's answer"},
      {"cli/map_start.cc first.mask", "asks whether there is one: if not, `NoMasks` segments"},
      {"cli/map_start.cc frame.mask", "asks whether all frames have one or none has"},
      {"cli/segment.cc frame.mask", "the truth that --score compares with"},
      {"cli/segment.cc true_frame.mask", "the truth that --score compares with"}};
  return readers;
}

// tests/eval/stripped_truth_test.cc shows that a map does not notice.
TEST(PipelineVerbs, AreTheOnlyReadersOfTheTruth) {
  const std::regex member(R"(([\w)\]]+)\s*(?:\.|->)(mask|T_WO)\b)");
  std::set<std::string> unseen;
  for (const auto& [reader, why] : AllowedReaders()) unseen.insert(reader);
  const fs::path root = TSDFPP_SOURCE_DIR;
  for (const char* room : {"mapper", "cli"}) {
    for (const auto& entry : fs::recursive_directory_iterator(root / room)) {
      if (!entry.is_regular_file()) continue;
      const std::string text = ReadFile(entry.path()).value();
      const std::string file = entry.path().lexically_relative(root).string();
      for (std::sregex_iterator it(text.begin(), text.end(), member), end; it != end; ++it) {
        const std::string reader = file + " " + it->str(1) + "." + it->str(2);
        EXPECT_TRUE(AllowedReaders().contains(reader)) << reader << " reads the truth";
        unseen.erase(reader);
      }
    }
  }
  EXPECT_TRUE(unseen.empty()) << *unseen.begin() << " is allowed and not there";
}

// Of the frame, whether it has a mask is all that the start of a map may ask.
TEST(PipelineVerbs, TheStartOfAMapAsksOnlyWhetherThereAreMasks) {
  const std::string text = ReadFile(fs::path(TSDFPP_SOURCE_DIR) / "cli" / "map_start.cc").value();
  const std::regex mask(R"(\.mask\b(?!\.empty\(\)))");
  EXPECT_FALSE(std::regex_search(text, mask));
}

// A mask over a brick and a ball far behind it, of which the ball does not become the brick's where
// masks are repaired, or it is asked for.
TEST(PipelineVerbs, AssociationPartsMasks) {
  constexpr double kUsual = VoteConfig::kUsualFarShare;
  for (const auto& [mode, far_share, is_parted] : {std::tuple{MaskRepairMode::kOff, -1.0, false},
                                                   {MaskRepairMode::kOn, -1.0, true},
                                                   {MaskRepairMode::kOff, kUsual, true},
                                                   {MaskRepairMode::kOn, 0.0, false}}) {
    SCOPED_TRACE(fmt::format("{} {}", MaskRepairModeName(mode), far_share));
    PipelineConfig config;
    config.method = Method::kTsdfppAnchored;
    config.map = ToyConfig();
    config.associate = AssociationMode::kVotes;
    config.poses = PoseSource::kTrack;
    config.tracked = TrackChoice::kAll;
    config.mask_repair = mode;
    config.votes.far_share = far_share;
    Pipeline pipeline(config, {});
    for (int i = 1; i < 10; ++i) {
      reference::Scene scene = TableOnly();
      AddBrick(scene, 0, {0.12, 0, kTableTop_m + 0.045});
      if (i > 4) AddBall(scene, {-0.2, 0.18, kTableTop_m + 0.055});
      Frame frame = reference::Render(scene, reference::LookAt({0.7, 0.02 * i, 0.2}, {0, 0, 0.05}),
                                      i, {256, 192, 215.0, 215.0, 127.5, 95.5});
      frame.mask.setTo(static_cast<double>(kBrick), frame.mask == static_cast<double>(kBall));
      ASSERT_TRUE(pipeline.Process(frame));
    }
    EXPECT_EQ(pipeline.map().Objects(), (std::vector<InstanceId>{0, 1}));
    // The brick is 150 mm long, the ball 300 mm off.
    const ObjectLookup lookup(pipeline.map());
    const auto boxes = lookup.BoxesOfSurfaces(std::array{std::size_t{0}});
    const double length_m = boxes.front().box_L.sizes().maxCoeff();
    EXPECT_EQ(length_m < 0.2, is_parted) << length_m;
  }
}

}  // namespace
}  // namespace tsdfpp
