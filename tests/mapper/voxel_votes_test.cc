// Association by votes (paper III-C) in analytic worlds: one id for each object whatever the masks
// call it, merged and split masks, objects that leave and come back, and what is hardly there.
// Longer than most files: each rule by itself, and all of them on whole sequences.
#include "mapper/associate/voxel_votes.h"

#include <gtest/gtest.h>

#include <functional>

#include "mapper/map_file.h"
#include "tests/mapper/every_method.h"
#include "tests/mapper/toy_votes.h"
#include "tests/reference/votes_reference.h"

namespace tsdfpp {
namespace {

// The labels that the truth would be given if each true object were one of the map: nothing where a
// pixel is otherwise, or two true objects are one.
void ExpectTrueLabels(const VoteWorld& world, const cv::Mat& labels, const cv::Mat& truth,
                      std::size_t objects, int most_left_out = 0) {
  std::map<InstanceId, InstanceId> id_of;
  for (const auto& [id, of] : world.truth_of()) {
    EXPECT_TRUE(id_of.emplace(of, id).second) << "object " << of << " has two ids";
  }
  EXPECT_EQ(id_of.size(), objects);
  int wrong = 0;
  int left_out = 0;
  for (int v = 0; v < truth.rows; ++v) {
    for (int u = 0; u < truth.cols; ++u) {
      const InstanceId of = truth.at<InstanceId>(v, u);
      const InstanceId expected = of == kBackground ? kBackground : id_of[of];
      const InstanceId found = labels.at<InstanceId>(v, u);
      wrong += found == expected || found == kNoInstance ? 0 : 1;
      left_out += found == kNoInstance && expected != kNoInstance ? 1 : 0;
    }
  }
  EXPECT_EQ(wrong, 0) << "pixels with another id";
  EXPECT_LE(left_out, most_left_out) << "pixels without an id";
}

class VoxelVotesOfMethod : public EveryMethodTest {};
TSDFPP_FOR_EVERY_VOXEL_METHOD(VoxelVotesOfMethod);

// The brick drives and turns (tsdf/static moves nothing, so there it stands still) until it reaches
// the tray, where one field of these large voxels mixes the two up.
TEST_P(VoxelVotesOfMethod, GiveEachObjectOneId) {
  ToyVotes world(GetParam());
  const int frames = IsOneField(GetParam()) ? 10 : 12;
  for (int i = 0; i < frames; ++i) {
    SCOPED_TRACE(i);
    const Frame frame = GetParam() == Method::kTsdfStatic
                            ? RenderToys(TableWithToys(), 0.2 + 0.4 * i, i)
                            : DriveFrame(i);
    const cv::Mat labels = world.Map(frame);
    if (i + 1 < kConfirmed) {
      EXPECT_EQ(CountOf(labels, kNoInstance), cv::countNonZero(frame.mask != 0));
      continue;
    }
    ExpectTrueLabels(world, labels, frame.mask, 3);
  }
  EXPECT_EQ(world.map().Objects(), (std::vector<InstanceId>{0, 1, 2, 3}));
  EXPECT_EQ(VoxelsOf(world.map()).FindFault(), std::nullopt);
}

// Each segment's votes, counted plainly, name the object that it joined; lists of the global map
// volume, asked point by point as the paper does, name the same.
TEST_P(VoxelVotesOfMethod, AreThePlainlyCountedOnes) {
  const VoteConfig config;
  ToyVotes world(GetParam());
  int compared = 0;
  for (int i = 0; i < 8; ++i) {
    const Frame frame = RenderToys(TableWithToys(), 0.2 + 0.4 * i, i);
    const cv::Mat segments = world.ids().Of(frame.mask);
    std::map<InstanceId, InstanceId> expected;
    for (const auto& [segment, truth] : VoteWorld::MostOf(segments, segments)) {
      const reference::Votes votes =
          reference::CountVotes(world.map(), frame, segments, segment, config.at_voxels);
      for (const auto& [id, count] : votes.nearest) {
        if (count < config.min_share * votes.points) continue;
        const auto known = expected.find(segment);
        if (known == expected.end() || count > votes.nearest.at(known->second)) {
          expected[segment] = id;
        }
      }
    }
    const std::unique_ptr<MapRepresentation> before = world.map().Clone();
    const cv::Mat labels = world.Map(frame, {segments, {}});
    for (const auto& [segment, label] : VoteWorld::MostOf(segments, labels)) {
      const bool is_old = i + 1 > kConfirmed;
      ASSERT_EQ(expected.contains(segment), is_old) << i;
      if (!is_old) continue;
      EXPECT_EQ(expected.at(segment), label) << i;
      ++compared;
    }
    // By the lists.
    std::map<InstanceId, std::map<InstanceId, int>> listed;
    for (int v = 0; v < segments.rows; ++v) {
      for (int u = 0; u < segments.cols; ++u) {
        const double z = frame.depth.at<float>(v, u);
        if (!IsValidDepth(frame.depth.at<float>(v, u))) continue;
        const Intrinsics& camera = frame.intrinsics;
        const Eigen::Vector3d p_W =
            frame.T_WC *
            Eigen::Vector3d((u - camera.cx) / camera.fx * z, (v - camera.cy) / camera.fy * z, z);
        const Eigen::Vector3d q = p_W / kToyVoxel_m;
        const auto list = VoxelsOf(*before).ListAt(q.array().round().cast<int>());
        if (list.empty() || list.front().id == kBackground) continue;
        ++listed[segments.at<InstanceId>(v, u)][list.front().id];
      }
    }
    for (const auto& [segment, id] : expected) {
      const auto& of = listed[segment];
      const auto most = std::max_element(
          of.begin(), of.end(), [](const auto& a, const auto& b) { return a.second < b.second; });
      ASSERT_NE(most, of.end());
      EXPECT_EQ(most->first, id);
    }
  }
  EXPECT_EQ(compared, 5 * 3);
}

// Fast: four voxels a frame, farther than points vote. The three last frames would do for near
// ones.
TEST(VoxelVotes, FollowsWhatMovesFartherThanPointsVote) {
  ToyVotes world;
  for (int i = 0; i < 8; ++i) {
    SCOPED_TRACE(i);
    reference::Scene scene = TableOnly();
    AddBall(scene, {-0.2 + 0.04 * i, -0.05, kTableTop_m + 0.055});
    const Frame frame = RenderToys(scene, 0.3, i);
    const cv::Mat labels = world.Map(frame);
    if (i + 1 >= kConfirmed) ExpectTrueLabels(world, labels, frame.mask, 1);
  }
}

// Where masks fall apart, or call two objects by each other's ids.
TEST(VoxelVotes, JoinsSegmentsOfOneObject) {
  ToyVotes world;
  for (int i = 0; i < 8; ++i) {
    const Frame frame = DriveFrame(i);
    cv::Mat segments = frame.mask.clone();
    if (i >= 4) {
      for (int v = 0; v < segments.rows; ++v) {
        for (int u = 0; u < segments.cols; ++u) {
          auto& id = segments.at<InstanceId>(v, u);
          if (id == kTray) id = static_cast<InstanceId>(40 + (u / 4) % 3);
          if (id == kBrick)
            id = kBall;
          else if (id == kBall)
            id = kBrick;
        }
      }
    }
    const cv::Mat labels = world.Map(frame, {segments, {}});
    if (i + 1 >= kConfirmed) ExpectTrueLabels(world, labels, frame.mask, 3);
  }
}

// One segment over two known objects is cut where they meet. What of a pixel's surface is new in
// the frame, and so farther than near_voxels from what was known, is left out: a few at the
// outlines.
TEST(VoxelVotes, CutsMergedSegments) {
  constexpr int kNewPixels = 20;
  ToyVotes world;
  for (int i = 0; i < 12; ++i) {
    SCOPED_TRACE(i);
    reference::Scene scene = TableWithToys();
    scene.T_WO[kBrick].translation().x() += 0.01 * i;
    const Frame frame = RenderToys(scene, 0.3 + 0.05 * i, i);
    cv::Mat segments = frame.mask.clone();
    if (i >= 4) segments.setTo(cv::Scalar(kBall), segments == static_cast<double>(kBrick));
    const cv::Mat labels = world.Map(frame, {segments, {}});
    if (i + 1 >= kConfirmed) {
      ExpectTrueLabels(world, labels, frame.mask, 3, i < 4 ? 0 : kNewPixels);
    }
  }
}

// Out of view for longer than candidates are remembered, or hidden behind another.
TEST(VoxelVotes, KnowsWhatComesBackWhereItWas) {
  ToyVotes world;
  for (int i = 0; i < 24; ++i) {
    SCOPED_TRACE(i);
    reference::Scene scene = TableWithToys();
    if (i >= 6 && i < 18) scene.Erase(kBall);  // as if something hid it
    Frame frame = RenderToys(scene, 0.3 + 0.02 * i, i);
    if (i >= 6 && i < 18) {
      frame.T_WO[kBall] = TableWithToys().T_WO.at(kBall);
      // Nobody sees through to the table, either.
      const Frame with_ball = RenderToys(TableWithToys(), 0.3 + 0.02 * i, i);
      frame.depth.setTo(cv::Scalar(0), with_ball.mask == static_cast<double>(kBall));
    }
    const cv::Mat labels = world.Map(frame);
    if (i + 1 >= kConfirmed) ExpectTrueLabels(world, labels, frame.mask, 3);
  }
}

// Two of the same form and colour, side by side, that set off together.
TEST(VoxelVotes, TellsTouchingTwinsApart) {
  constexpr InstanceId kTwin = 9;
  ToyVotes world;
  for (int i = 0; i < 10; ++i) {
    reference::Scene scene = TableOnly();
    const double x = -0.15 + 0.02 * i;
    AddBrick(scene, 0, {x, 0.02, kTableTop_m + 0.045});
    scene.shapes.push_back(
        reference::Cuboid(kTwin, {200, 30, 30}, Pose::Identity(), {0.075, 0.05, 0.045}));
    scene.T_WO[kTwin] =
        reference::MakePose(0, Eigen::Vector3d::UnitZ(), {x + 0.15, 0.02, kTableTop_m + 0.045});
    const Frame frame = RenderToys(scene, 0.3 + 0.2 * i, i);
    const cv::Mat labels = world.Map(frame);
    if (i + 1 >= kConfirmed) ExpectTrueLabels(world, labels, frame.mask, 2);
  }
}

// A segment that is there in fewer frames than it takes is in no map; nor is one of too few points,
// however long.
TEST(VoxelVotes, HoldsBackWhatIsSmallOrShortLived) {
  ToyVotes world;
  ToyVotes without;
  for (int i = 0; i < 14; ++i) {
    Frame frame = RenderToys(TableWithToys(), 0.3 + 0.05 * i, i);
    const cv::Mat quiet = world.ids().Of(frame.mask);
    cv::Mat blank = quiet.clone();
    blank(cv::Rect(4, 60, 3, 3)) = kNoInstance;
    blank(cv::Rect(80, 60, 10, 10)) = i % 5 < 2 ? kNoInstance : kBackground;
    cv::Mat noisy = blank.clone();
    noisy.setTo(cv::Scalar(77), blank == static_cast<double>(kNoInstance));
    noisy(cv::Rect(4, 60, 3, 3)) = 78;
    world.Map(frame, {noisy, {}});
    without.Map(frame, {blank, {}});
  }
  EXPECT_EQ(world.map().Objects().size(), 4U);
  EXPECT_TRUE(MapToBytes(world.map()).value() == MapToBytes(without.map()).value());
}

// Nothing that a mask may hold stops it or enters the map.
TEST(VoxelVotes, TakesWhatIsHardlyThere) {
  const std::vector<std::pair<std::string, std::function<void(Frame&, cv::Mat&)>>> cases{
      {"a segment without depth",
       [](Frame& frame, cv::Mat& segments) {
         segments(cv::Rect(0, 0, 20, 20)) = 500;
         frame.depth(cv::Rect(0, 0, 20, 20)) = 0;
       }},
      {"three points", [](Frame&, cv::Mat& segments) { segments(cv::Rect(30, 66, 3, 1)) = 500; }},
      {"one pixel",
       [](Frame&, cv::Mat& segments) { segments.at<InstanceId>(66, 40) = kNoInstance - 1; }},
      {"one pixel a segment",
       [](Frame&, cv::Mat& segments) {
         for (int u = 0; u < segments.cols; ++u) {
           segments.at<InstanceId>(70, u) = static_cast<InstanceId>(1000 + u);
         }
       }},
      {"no depth at all", [](Frame& frame, cv::Mat&) { frame.depth = 0; }},
      {"depth that is none",
       [](Frame& frame, cv::Mat& segments) {
         segments = 500;
         frame.depth = std::numeric_limits<float>::quiet_NaN();
       }},
      {"nobody's", [](Frame&, cv::Mat& segments) { segments = kNoInstance; }},
  };
  for (const auto& [name, spoil] : cases) {
    SCOPED_TRACE(name);
    ToyVotes world;
    for (int i = 0; i < 10; ++i) {
      Frame frame = DriveFrame(i);
      cv::Mat segments = world.ids().Of(frame.mask);
      if (i % 2 == 1) spoil(frame, segments);
      const cv::Mat labels = world.Map(frame, {segments, {}});
      EXPECT_EQ(labels.size(), segments.size());
    }
    EXPECT_EQ(world.map().Objects(), (std::vector<InstanceId>{0, 1, 2, 3}));
    EXPECT_EQ(VoxelsOf(world.map()).FindFault(), std::nullopt);
  }
}

TEST(VoxelVotes, NeverUseAnIdTwice) {
  const auto map = MakeMap(Method::kTsdfppAnchored, ToyConfig());
  VoteConfig config;
  config.confirm_frames = 1;
  VoxelVotes votes(config, kNoInstance - 2);
  const auto show = [&](const Frame& frame, const cv::Mat& segments) {
    const cv::Mat labels = votes.Associate(frame, {segments, {}}, *map).labels;
    votes.Accept();
    return VoteWorld::MostOf(labels, frame.mask);
  };
  std::set<InstanceId> ids;
  for (int i = 0; i < 3; ++i) {
    const Frame frame = RenderToys(TableWithToys(), 0.3, i);
    for (const auto& [id, truth] : show(frame, frame.mask)) {
      // The map stays empty, and what is out of sight for so long is new.
      EXPECT_TRUE(ids.insert(id).second) << id;
    }
    EXPECT_EQ(votes.Remarks().size(), 1U);
    const cv::Mat none(frame.mask.size(), CV_16UC1, cv::Scalar(kBackground));
    for (int k = 0; k < config.confirm_window; ++k) show(frame, none);
  }
  EXPECT_EQ(ids, (std::set<InstanceId>{kNoInstance - 2, kNoInstance - 1}));
}

// The tracker freezes what has too few points for it, so that nothing of it is ever fused.
TEST(VoxelVotes, WhatIsNeverFusedIsBornOnce) {
  const auto map = MakeMap(Method::kTsdfppAnchored, ToyConfig());
  VoxelVotes votes({});
  std::map<InstanceId, InstanceId> first;
  for (int i = 0; i < 12; ++i) {
    const Frame frame = RenderToys(TableWithToys(), 0.3 + 0.02 * i, i);
    const cv::Mat labels = votes.Associate(frame, {frame.mask, {}}, *map).labels;
    votes.Accept();
    const auto ids = VoteWorld::MostOf(labels, frame.mask);
    if (i + 1 == kConfirmed) first = ids;
    EXPECT_EQ(ids, first) << i;
  }
  EXPECT_GE(first.size(), 3U);
}

// One that the map has from elsewhere is nobody else's.
TEST(VoxelVotes, CountOnFromTheMapsIds) {
  VoteConfig config;
  config.confirm_frames = 1;
  VoxelVotes votes(config);
  const auto map = MakeMap(Method::kTsdfppAnchored, ToyConfig());
  Frame frame = RenderToys(TableOnly(), 0.3, 1);
  frame.mask(cv::Rect(40, 30, 16, 16)) = 500;
  SetPosesThenFuse(*map, frame);
  const Frame toys = RenderToys(TableWithToys(), 0.3, 2);
  for (const auto& [id, truth] :
       VoteWorld::MostOf(votes.Associate(toys, {toys.mask, {}}, *map).labels, toys.mask)) {
    EXPECT_GE(id, 500);
  }
}

// A frame that is refused after it was associated is as if it had not been there.
TEST(VoxelVotes, ForgetsARefusedFrame) {
  const auto map = MakeMap(Method::kTsdfppAnchored, ToyConfig());
  VoxelVotes votes{VoteConfig()};
  for (int i = 0; i < 2 * kConfirmed; ++i) {
    const Frame frame = RenderToys(TableWithToys(), 0.3, i);
    const cv::Mat labels = votes.Associate(frame, {frame.mask, {}}, *map).labels;
    EXPECT_EQ(CountOf(labels, kNoInstance), cv::countNonZero(frame.mask != 0)) << i;
  }
}

TEST(VoxelVotes, ClassesGoToTheObjects) {
  ToyVotes world;
  for (int i = 0; i < 5; ++i) {
    const Frame frame = RenderToys(TableWithToys(), 0.3 + 0.1 * i, i);
    const Segments segments{frame.mask, {{kBall, "ball"}, {kTray, "tray"}, {99, "nothing"}}};
    if (i < 4) {
      world.Map(frame, segments);
      continue;
    }
    const AssociatedObjects last = world.votes().Associate(frame, segments, world.map());
    ASSERT_EQ(last.classes.size(), 2U);
    for (const auto& [id, name] : last.classes) {
      EXPECT_EQ(name, world.truth_of().at(id) == kBall ? "ball" : "tray");
    }
  }
}

// A network that looks at every third frame says nothing of those between.
TEST(VoxelVotes, FramesThatSayNothingCountForNothing) {
  ToyVotes world;
  for (int i = 0; i < 12; ++i) {
    const Frame frame = RenderToys(TableWithToys(), 0.2 + 0.05 * i, i);
    if (i % 3 == 0) {
      world.Map(frame);
      continue;
    }
    const cv::Mat nothing(frame.mask.size(), CV_16UC1, cv::Scalar(kNoInstance));
    const cv::Mat labels = world.Map(frame, {nothing, {}, {}});
    EXPECT_EQ(CountOf(labels, kNoInstance), static_cast<int>(labels.total()));
  }
  EXPECT_EQ(world.map().Objects(), (std::vector<InstanceId>{0, 1, 2, 3}));
}

// To ask is slow, and a piece of a table begins nothing anyhow.
TEST(VoxelVotes, AsksForWhatIsMissingOnlyWhereSomethingMayBegin) {
  ToyVotes world;
  const Frame frame = RenderToys(TableWithToys(), 0.2);
  const auto asked = [&](const std::vector<InstanceId>& unknown) {
    int count = 0;
    world.votes().ExpectReturns([&](const auto&, const auto&) { return ++count > 0; });
    world.votes().Associate(frame, {frame.mask, {}, unknown}, world.map());
    world.votes().ExpectReturns({});
    return count;
  };
  EXPECT_EQ(asked({}), 3);
  EXPECT_EQ(asked({kBrick, kTray}), 1);
}

// All that is stored of free space is that the surface is not near.
TEST(ObjectLookup, SaysNothingOfFreeSpace) {
  const auto map = MakeMap(Method::kTsdfppAnchored, ToyConfig());
  for (int i = 0; i < 3; ++i) {
    const Frame frame = RenderToys(TableWithToys(), 0.2 + 0.05 * i, i);
    for (const auto& [id, pose] : frame.T_WO) map->SetObjectPose(id, pose);
    map->Fuse(frame, frame.mask);
  }
  const ObjectLookup lookup(*map);
  const std::vector<std::size_t> brick{*lookup.NumberOf(kBrick)};
  const Eigen::Vector3d top_W(-0.14, 0.03, kTableTop_m + 0.09);
  std::vector<ObjectLookup::Distance> distances;
  const auto answers_at = [&](double voxels) {
    lookup.Distances(top_W + voxels * kToyVoxel_m * Eigen::Vector3d::UnitZ(), brick, distances);
    return distances.size();
  };
  EXPECT_EQ(answers_at(0), 1U);
  // Distances are along rays, and these come at some 60 degrees.
  EXPECT_EQ(answers_at(1), 1U);
  EXPECT_EQ(answers_at(ToyConfig().trunc_front_voxels), 0U);
}

TEST(VoteConfig, SurvivesToml) {
  const VoteConfig config{1.25, 0.25, 0.15, 4, 0.6, 2, 1000, 40, 2, 4, 30, 0.3};
  const auto read = VoteConfig::FromToml(config.ToToml(), "t.toml");
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(*read, config);
  EXPECT_EQ(*VoteConfig::FromToml(toml::table{}, "t.toml"), VoteConfig{});
}

TEST(VoteConfig, NamesWhatIsWrong) {
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"at_voxels = 0.0", "'at_voxels' is 0, expected 0.5 to 100"},
      {"min_share = 0.0", "'min_share' is 0, expected 0.01 to 1"},
      {"cut_share = 2.0", "'cut_share' is 2, expected 0.01 to 1"},
      {"near_voxels = 0.1", "'near_voxels' is 0.1, expected 0.5 to 100"},
      {"near_voxels = 1.0", "'at_voxels' is 1.5, expected at most 'near_voxels', which is 1"},
      {"near_share = -1.0", "'near_share' is -1, expected 0.01 to 1"},
      {"recent_frames = -1", "'recent_frames' is -1, expected 0 to 1000"},
      {"max_points = 0", "'max_points' is 0, expected 1 to 1000000"},
      {"min_points = 0", "'min_points' is 0, expected 1 to 1000000"},
      {"max_points = 40", "'min_points' is 50, expected at most 'max_points', which is 40"},
      {"far_share = -1.1", "'far_share' is -1.1, expected -1 to 100"},
      {"confirm_frames = 0", "'confirm_frames' is 0, expected 1 to 1000"},
      {"confirm_window = 2",
       "'confirm_frames' is 3, expected at most 'confirm_window', which is 2"},
      {"votes = 2", "votes"}};
  for (const auto& [text, sentence] : cases) {
    SCOPED_TRACE(text);
    const auto table = ParseToml(text, "t.toml");
    ASSERT_TRUE(table);
    const auto config = VoteConfig::FromToml(*table, "t.toml");
    ASSERT_FALSE(config);
    EXPECT_EQ(config.error().kind, ErrorKind::kUsage);
    EXPECT_NE(config.error().message.find(sentence), std::string::npos) << config.error().message;
  }
}

}  // namespace
}  // namespace tsdfpp
