// Objects that leave the picture and come back elsewhere: they keep their model and their id, and
// nothing else is taken for them. Longer than most files: it all happens to one brick.
#include "mapper/track/lost_objects.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>
#include <optional>

#include "core/units.h"
#include "mapper/pipeline.h"
#include "mapper/voxel_inspection.h"
#include "tests/mapper/toy_scene.h"
#include "tests/mapper/vote_world.h"

namespace tsdfpp {
namespace {

using reference::MakePose;

constexpr int kLeaves = 6;    // the first frame without the brick
constexpr int kReturns = 10;  // the first with it again
constexpr int kFrames = 16;
// A pixel sees some 4 mm of these scenes; a flat side is known to less than that.
constexpr double kMost_voxels = 0.5;
// Where half of what is seen of it is new.
constexpr double kMostTurned_voxels = 1;

Intrinsics Camera() { return {256, 192, 215.0, 215.0, 127.5, 95.5}; }

const Eigen::Vector3d kBefore(-0.12, -0.06, kTableTop_m + 0.045);
const Eigen::Vector3d kAfter(0.12, -0.1, kTableTop_m + 0.045);

// The brick is there, is gone, and comes back at another place, turned.
Frame Coming(int index, double turn_rad) {
  reference::Scene scene = TableOnly();
  if (index < kLeaves) AddKnobbedBrick(scene, 0.3, kBefore);
  if (index >= kReturns) AddKnobbedBrick(scene, 0.3 + turn_rad, kAfter);
  AddTray(scene, -0.4, {0.05, 0.14, kTableTop_m + 0.016});
  return reference::Render(scene, CircleCamera(0.02 * index), index, Camera());
}

PipelineConfig TrackConfig(AssociationMode associate) {
  PipelineConfig config;
  config.map = ToyConfig();
  config.method = Method::kTsdfppAnchored;
  config.associate = associate;
  config.poses = PoseSource::kTrack;
  config.tracked = TrackChoice::kAll;
  return config;
}

std::vector<ObjectInfo> Toys() {
  return {{kBackground, "background", ""}, {kBrick, "brick", ""}, {kTray, "tray", ""}};
}

// Those that are not 0.
LoosePixels PixelsWhere(const cv::Mat& segment) {
  LoosePixels pixels;
  for (int pixel = 0; pixel < segment.rows * segment.cols; ++pixel) {
    if (segment.at<std::uint8_t>(pixel / segment.cols, pixel % segment.cols) != 0) {
      pixels.push_back(pixel);
    }
  }
  return pixels;
}

std::size_t VoxelsOfBrick(const Pipeline& pipeline, InstanceId id = kBrick) {
  return VoxelsOf(pipeline.map()).ObservedVoxels(id).size();
}

struct ReturnedBrick {
  TrackSpan span{};
  std::size_t before = 0;  // voxels, and at the end
  std::size_t after = 0;
  // Of its middle's place, voxels; nothing where it is not in the map.
  std::optional<double> error_voxels{};
};

ReturnedBrick BrickThatReturns(double turn_rad, int frames) {
  ReturnedBrick result;
  Pipeline pipeline(TrackConfig(AssociationMode::kGiven), Toys());
  for (int i = 1; i < kLeaves; ++i) EXPECT_TRUE(pipeline.Process(Coming(i, 0)));
  result.before = VoxelsOfBrick(pipeline);
  for (int i = kLeaves; i < kReturns; ++i) EXPECT_TRUE(pipeline.Process(Coming(i, 0)));
  // It is known not to be where it was.
  EXPECT_EQ(VoxelsOfBrick(pipeline), 0U);
  EXPECT_FALSE(pipeline.trajectories().at(kBrick).contains(kReturns - 1));
  EXPECT_EQ(pipeline.Remarks(),
            std::vector<std::string>{"where 1 of the tracked objects went is not known, so the map "
                                     "has nothing of them: brick"});
  for (int i = kReturns; i <= frames; ++i) EXPECT_TRUE(pipeline.Process(Coming(i, turn_rad)));
  result.span = pipeline.track_log().objects().at(kBrick);
  result.after = VoxelsOfBrick(pipeline);
  const auto& poses = pipeline.trajectories().at(kBrick);
  if (poses.contains(frames)) {
    const Pose truth =
        Coming(frames, turn_rad).T_WO.at(kBrick) * Coming(1, 0).T_WO.at(kBrick).inverse();
    const Pose error = truth.inverse() * poses.at(frames);
    result.error_voxels = (error * kBefore - kBefore).norm() / kToyVoxel_m;
  }
  EXPECT_EQ(pipeline.track_log().objects().at(kTray).lost, 0);
  return result;
}

TEST(LostObjects, AreKeptWholeAndFoundElsewhere) {
  for (const double turn_deg : {0.0, 40.0, 110.0}) {
    SCOPED_TRACE(turn_deg);
    const ReturnedBrick brick = BrickThatReturns(turn_deg * kDegree, kFrames);
    EXPECT_EQ(brick.span.lost, 1);
    EXPECT_EQ(brick.span.found, 1);
    EXPECT_EQ(brick.span.begun_anew, 0);
    EXPECT_GE(brick.after, brick.before);
    ASSERT_TRUE(brick.error_voxels);
    EXPECT_LT(*brick.error_voxels, turn_deg > 90 ? kMostTurned_voxels : kMost_voxels);
  }
}

// Half a turn shows what the model lacks but for its top, which would fit in more than one place.
TEST(LostObjects, WaitWhereNothingSaysHowTheyStand) {
  const int frames = SdfTrackConfig{}.return_frames;
  const ReturnedBrick waiting = BrickThatReturns(-70 * kDegree, kReturns + frames - 1);
  EXPECT_EQ(waiting.span.found, 0);
  EXPECT_EQ(waiting.after, 0U);
  const ReturnedBrick anew = BrickThatReturns(-70 * kDegree, kReturns + frames + 2);
  EXPECT_EQ(anew.span.found, 1);
  EXPECT_EQ(anew.span.begun_anew, 1);
  EXPECT_GT(anew.after, 0U);
}

// With ids of one frame alone it is the same object, and no other is born.
TEST(LostObjects, ComeBackWithTheirId) {
  Pipeline pipeline(TrackConfig(AssociationMode::kVotes), {});
  DrawnIds drawn(5);
  const auto process = [&](int index) {
    Frame frame = Coming(index, 40 * kDegree);
    const cv::Mat truth = frame.mask;
    frame.mask = drawn.Of(truth);
    ASSERT_TRUE(pipeline.Process(frame));
    if (index < 4 || (index >= kLeaves && index < kReturns)) return;
    InstanceId id = kNoInstance;  // of the brick, whose pixels have no other
    for (int v = 0; v < truth.rows; ++v) {
      for (int u = 0; u < truth.cols; ++u) {
        const InstanceId label = pipeline.labels().at<InstanceId>(v, u);
        if (truth.at<InstanceId>(v, u) != kBrick || label == kNoInstance) continue;
        if (id == kNoInstance) id = label;
        ASSERT_EQ(label, id);
      }
    }
    EXPECT_NE(id, kNoInstance) << index;
    EXPECT_LE(id, 2);
  };
  for (int i = 1; i <= kFrames; ++i) process(i);
  EXPECT_EQ(pipeline.Objects().size(), 3U);
}

// Where one is missing, another is a new object, as soon as if none were.
TEST(LostObjects, NothingElseIsTakenForThem) {
  Pipeline pipeline(TrackConfig(AssociationMode::kVotes), {});
  const auto frame_of = [](int index) {
    reference::Scene scene = TableOnly();
    if (index < kLeaves) AddKnobbedBrick(scene, 0.3, kBefore);
    if (index >= kReturns) AddBall(scene, {0.12, -0.1, kTableTop_m + 0.055});
    AddTray(scene, -0.4, {0.05, 0.14, kTableTop_m + 0.016});
    return reference::Render(scene, CircleCamera(0.02 * index), index, Camera());
  };
  const int born = kReturns + VoteConfig{}.confirm_frames - 1;
  for (int i = 1; i < born; ++i) ASSERT_TRUE(pipeline.Process(frame_of(i)));
  EXPECT_EQ(pipeline.Objects().size(), 3U);
  for (int i = born; i <= kFrames; ++i) ASSERT_TRUE(pipeline.Process(frame_of(i)));
  EXPECT_EQ(pipeline.Objects().size(), 4U);
  for (const auto& [id, span] : pipeline.track_log().objects()) EXPECT_EQ(span.found, 0);
}

// What is too small to be looked for is begun anew as well, where its segment is.
TEST(LostObjects, SmallOnesBeginAnewWhereTheirSegmentIs) {
  PipelineConfig config = TrackConfig(AssociationMode::kGiven);
  config.track.max_points = 90;
  Pipeline pipeline(config, Toys());
  const int last = kReturns + config.track.return_frames + 1;
  for (int i = 1; i <= last; ++i) ASSERT_TRUE(pipeline.Process(Coming(i, 0)));
  EXPECT_EQ(pipeline.track_log().objects().at(kBrick).begun_anew, 1);
  EXPECT_EQ(pipeline.track_log().objects().at(kBrick).first, 1);
  EXPECT_GT(VoxelsOfBrick(pipeline), 0U);
  const auto& poses = pipeline.trajectories().at(kBrick);
  ASSERT_TRUE(poses.contains(last));
  const Pose truth = Coming(last, 0).T_WO.at(kBrick) * Coming(1, 0).T_WO.at(kBrick).inverse();
  // Another side of it is in sight there: the middles of two of its faces are as far apart.
  const double most_m = std::hypot(0.075, 0.05);
  EXPECT_LT((poses.at(last) * kBefore - truth * kBefore).norm(), most_m);
}

// An object that a map's file has a pose of, but that is not tracked now, is fused where it is
// seen.
TEST(LostObjects, AreOnlyThoseThatAreTracked) {
  PipelineConfig config = TrackConfig(AssociationMode::kGiven);
  auto map = MakeMap(config.method, config.map);
  const Frame first = Coming(1, 0);
  map->SetObjectPose(kBrick, Pose::Identity());
  map->Fuse(first, first.mask);
  config.tracked = TrackChoice::kClassified;
  Pipeline pipeline(config, Toys(), std::move(map), {{kBrick, {{1, Pose::Identity()}}}});
  for (int i = kReturns; i <= kReturns + 2; ++i) ASSERT_TRUE(pipeline.Process(Coming(i, 0)));
  EXPECT_TRUE(pipeline.track_log().objects().empty());
  EXPECT_GT(VoxelsOfBrick(pipeline), 0U);
  EXPECT_TRUE(pipeline.Remarks().size() == 1U) << "that nothing was tracked";
}

// Between the frames that a network looks at, nothing has a label.
TEST(LostObjects, FramesWithoutLabelsLoseNothing) {
  Pipeline pipeline(TrackConfig(AssociationMode::kGiven), Toys());
  for (int i = 1; i < kLeaves; ++i) ASSERT_TRUE(pipeline.Process(Coming(i, 0)));
  const std::size_t before = VoxelsOfBrick(pipeline);
  Frame blank = Coming(kLeaves, 0);
  blank.mask.setTo(static_cast<double>(kNoInstance));
  ASSERT_TRUE(pipeline.Process(blank));
  EXPECT_EQ(VoxelsOfBrick(pipeline), before);
  EXPECT_EQ(pipeline.track_log().objects().at(kBrick).lost, 0);
}

// Where a frame is refused, objects that it lacked, or that were found in it, are as they were.
TEST(LostObjects, CanBeUndone) {
  const Frame frame = Coming(1, 0);
  const auto map = MakeMap(Method::kTsdfppAnchored, ToyConfig());
  ObjectPoses T_WO{{kBrick, Pose::Identity()}};
  map->SetObjectPose(kBrick, Pose::Identity());
  map->Fuse(frame, frame.mask);
  const auto voxels = VoxelsOf(*map).ObservedVoxels(kBrick);
  Pose elsewhere = Pose::Identity();
  elsewhere.translation().x() = 0.3;
  LostObjects lost(SdfTrackConfig{});
  for (const bool is_found : {false, true}) {
    lost.Keep(kBrick, *map, T_WO.at(kBrick));
    std::vector<InstanceId> found;
    if (is_found) {
      ASSERT_TRUE(lost.PutBack({kBrick, 0, elsewhere, false}, *map, T_WO));
      EXPECT_EQ(T_WO.at(kBrick).translation().x(), 0.3);
      found.push_back(kBrick);
    }
    lost.Undo(found, *map, T_WO);
    EXPECT_TRUE(lost.empty());
    EXPECT_EQ(T_WO.at(kBrick).matrix(), Pose::Identity().matrix());
    EXPECT_EQ(VoxelsOf(*map).ObservedVoxels(kBrick).size(), voxels.size());
  }
  // Of one that was lost in an earlier frame nothing is in the map.
  lost.Keep(kBrick, *map, T_WO.at(kBrick));
  EXPECT_EQ(lost.TakeOut({}, *map, T_WO), std::vector<InstanceId>{kBrick});
  EXPECT_FALSE(T_WO.contains(kBrick));
  ASSERT_TRUE(lost.PutBack({kBrick, 0, elsewhere, false}, *map, T_WO));
  EXPECT_EQ(VoxelsOf(*map).ObservedVoxels(kBrick).size(), voxels.size());
  lost.Undo({kBrick}, *map, T_WO);
  EXPECT_TRUE(lost.Has(kBrick));
  EXPECT_FALSE(T_WO.contains(kBrick));
  EXPECT_EQ(VoxelsOf(*map).ObservedVoxels(kBrick).size(), 0U);
}

// What was found, and then cannot be registered there in any frame, was not found.
TEST(LostObjects, AreBegunAnewWhereTheyCannotBeRegistered) {
  const Frame frame = Coming(1, 0);
  const SdfTrackConfig config;
  const LoosePixels pixels = PixelsWhere(frame.mask == kBrick);
  const std::map<InstanceId, LoosePixels> shown{{kBrick, pixels}};
  const LoosePixels few(pixels.begin(), pixels.begin() + 10);
  const LostObjects::Segment segment{pixels, kBrick};
  for (const bool is_registered_once : {false, true}) {
    SCOPED_TRACE(is_registered_once);
    const auto map = MakeMap(Method::kTsdfppAnchored, ToyConfig());
    ObjectPoses T_WO{{kBrick, Pose::Identity()}};
    map->SetObjectPose(kBrick, Pose::Identity());
    map->Fuse(frame, frame.mask);
    LostObjects lost(config);
    lost.Keep(kBrick, *map, T_WO.at(kBrick));
    Pose elsewhere = Pose::Identity();
    elsewhere.translation().x() = 0.02;
    ASSERT_TRUE(lost.PutBack({kBrick, 0, elsewhere, false}, *map, T_WO));
    EXPECT_TRUE(lost.TakeOut({kBrick}, *map, T_WO).empty());
    for (int i = 0; i < config.return_frames; ++i) {
      lost.GiveUpUnsure(frame, shown, *map, T_WO);
      EXPECT_TRUE(lost.empty()) << i;
      const bool is_registered = is_registered_once && i == 3;
      lost.Watch({{kBrick, is_registered ? TrackStatus::kTracked : TrackStatus::kFrozen},
                  {kTray, TrackStatus::kFrozen}});
    }
    lost.GiveUpUnsure(frame, {}, *map, T_WO);
    EXPECT_TRUE(lost.empty()) << "it is not in sight";
    lost.GiveUpUnsure(frame, {{kBrick, few}}, *map, T_WO);
    EXPECT_TRUE(lost.empty()) << "too little of it is";
    lost.GiveUpUnsure(frame, shown, *map, T_WO);
    ASSERT_EQ(lost.Has(kBrick), !is_registered_once);
    if (is_registered_once) continue;
    const auto returns = lost.FindAgain(frame, {&segment, 1});
    ASSERT_EQ(returns.size(), 1U);
    EXPECT_TRUE(returns[0].begins_anew);
    EXPECT_EQ(returns[0].T_WO.matrix(), elsewhere.matrix());
    ASSERT_TRUE(lost.PutBack(returns[0], *map, T_WO));
    EXPECT_TRUE(VoxelsOf(*map).ObservedVoxels(kBrick).empty());
  }
}

// A map of which the brick was seen until it left the view, and is lost.
struct LostBrick {
  LostBrick() {
    map->SetObjectPose(kBrick, Pose::Identity());
    for (int i = 1; i < kLeaves; ++i) {
      const Frame before = Coming(i, 0);
      map->Fuse(before, before.mask);
    }
    lost.Keep(kBrick, *map, Pose::Identity());
    lost.TakeOut({}, *map, T_WO);
  }

  std::unique_ptr<MapRepresentation> map = MakeMap(Method::kTsdfppAnchored, ToyConfig());
  ObjectPoses T_WO{{kBrick, Pose::Identity()}};
  LostObjects lost{SdfTrackConfig{}};
};

// One that is found is tracked on by the model by which it was tracked; one that was something else
// in between is not.
TEST(LostObjects, SayWhoseModelTheyComeBackWith) {
  const Frame after = Coming(kReturns, 40 * kDegree);
  const LoosePixels pixels = PixelsWhere(after.mask == kBrick);
  const LostObjects::Segment segment{pixels, kBrick};
  for (const bool was_on_trial : {false, true}) {
    SCOPED_TRACE(was_on_trial);
    auto [map, T_WO, lost] = LostBrick();
    if (was_on_trial) {
      ASSERT_TRUE(lost.PutBack({kBrick, 0, Pose::Identity(), true}, *map, T_WO));
      lost.TakeOut({kBrick}, *map, T_WO);
      ASSERT_TRUE(lost.empty());
      lost.AskTrials(after, {{kBrick, pixels}});
    }
    const auto returns = lost.FindAgain(after, {&segment, 1});
    ASSERT_EQ(returns.size(), 1U);
    EXPECT_FALSE(returns[0].begins_anew);
    EXPECT_EQ(returns[0].model, was_on_trial ? PlacedModel::kOther : PlacedModel::kSame);
  }
}

// A search takes many times as long as to track what is there. So it is made in every third frame,
// also where what is like the object is such that no model may begin with it.
TEST(LostObjects, AreLookedForInEveryThirdFrame) {
  LostBrick kept;
  const auto found = [&](double turn_deg) {
    const Frame frame = Coming(kReturns, turn_deg * kDegree);
    const LostObjects::Segment segment{PixelsWhere(frame.mask == kBrick), kNoInstance, false};
    return !kept.lost.FindAgain(frame, {&segment, 1}).empty();
  };
  EXPECT_FALSE(found(-70)) << "nothing says how it stands";
  EXPECT_FALSE(found(40));
  EXPECT_FALSE(found(40));
  EXPECT_TRUE(found(40));
}

// Among many pieces of the room that have its colours, too, it is looked for in what is known
// first.
TEST(LostObjects, AreLookedForInKnownSegmentsFirst) {
  LostBrick kept;
  // Nothing says how it stands in any of these, all as alike.
  const Frame frame = Coming(kReturns, 40 * kDegree);
  const LoosePixels brick = PixelsWhere(frame.mask == kBrick);
  std::vector<LostObjects::Segment> segments(20, {brick, kNoInstance, false, false});
  segments.push_back({brick, kNoInstance, true, true});
  const auto returns = kept.lost.FindAgain(frame, segments);
  ASSERT_EQ(returns.size(), 1U);
  EXPECT_EQ(returns[0].segment, segments.size() - 1);
}

// A gate that says no in every frame does so in the pipeline.
TEST(LostObjects, AreBegunAnewInThePipeline) {
  PipelineConfig config = TrackConfig(AssociationMode::kGiven);
  config.track.min_observed_share = 0.99;
  Pipeline pipeline(config, Toys());
  const int last = kReturns + config.track.return_frames;
  ASSERT_TRUE(pipeline.Process(Coming(1, 110 * kDegree)));
  const TrackSpan& brick = pipeline.track_log().objects().at(kBrick);
  for (int i = 2; i <= last; ++i) {
    ASSERT_TRUE(pipeline.Process(Coming(i, 110 * kDegree)));
    EXPECT_EQ(brick.begun_anew, i == last ? 1 : 0) << i;
  }
  EXPECT_EQ(brick.tracked, 0);
  EXPECT_EQ(brick.lost, 1);
  EXPECT_EQ(brick.found, 1);
  EXPECT_GT(VoxelsOfBrick(pipeline), 0U);
}

// Whatever the number of threads.
TEST(LostObjects, AreFoundAtTheSamePlaceByAnyNumberOfThreads) {
  std::vector<std::map<int, Pose>> poses;
  for (const std::size_t threads : {1U, 2U, 5U}) {
    tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    Pipeline pipeline(TrackConfig(AssociationMode::kGiven), Toys());
    for (int i = 1; i < kReturns + 2; ++i) {
      ASSERT_TRUE(pipeline.Process(Coming(i, 40 * kDegree)));
    }
    poses.push_back(pipeline.trajectories().at(kBrick));
  }
  ASSERT_TRUE(poses[0].contains(kReturns + 1));
  for (const auto& of : poses) {
    ASSERT_EQ(of.size(), poses[0].size());
    for (const auto& [frame, pose] : of) EXPECT_EQ(pose.matrix(), poses[0].at(frame).matrix());
  }
}

// What something stands before is where it was.
TEST(LostObjects, WhatIsHiddenIsNotLost) {
  Pipeline pipeline(TrackConfig(AssociationMode::kGiven), Toys());
  const auto frame_of = [](int index) {
    reference::Scene scene = TableOnly();
    AddKnobbedBrick(scene, 0.3, kBefore);
    const Pose T_WC = CircleCamera(0);
    if (index >= kLeaves) {
      // A screen half way to it.
      const Eigen::Vector3d half = (T_WC.translation() + kBefore) / 2;
      scene.shapes.push_back(
          reference::Cuboid(kTray, {30, 180, 30}, Pose::Identity(), {0.2, 0.2, 0.01}));
      scene.T_WO[kTray] = T_WC;
      scene.T_WO[kTray].translation() = half;
    }
    return reference::Render(scene, T_WC, index, Camera());
  };
  for (int i = 1; i <= kReturns; ++i) ASSERT_TRUE(pipeline.Process(frame_of(i)));
  EXPECT_EQ(pipeline.track_log().objects().at(kBrick).lost, 0);
  EXPECT_GT(VoxelsOfBrick(pipeline), 0U);
}

// What was moved a little while nobody looked covers most of its old place itself (towards the
// camera all of it, which is then not known). A segment that shows it where it was, with something
// else, does not speak against that place.
TEST(LostObjects, AreNotInPlaceWhereTheyWereMovedALittle) {
  Pipeline pipeline(TrackConfig(AssociationMode::kGiven), Toys());
  const auto frame_of = [](int index, const Eigen::Vector3d& way, double turn_rad) {
    reference::Scene scene = TableOnly();
    AddKnobbedBrick(scene, 0.3 + turn_rad, kBefore + way);
    AddTray(scene, -0.4, {0.05, 0.14, kTableTop_m + 0.016});
    return reference::Render(scene, CircleCamera(0.02 * index), index, Camera());
  };
  for (int i = 1; i < kLeaves; ++i) ASSERT_TRUE(pipeline.Process(frame_of(i, {0, 0, 0}, 0)));
  const LostObjects lost{SdfTrackConfig{}};
  const auto is_lost = [&](const Frame& frame, const cv::Mat& segment) {
    const LoosePixels pixels = PixelsWhere(segment);
    const ObjectPoses asked{{kBrick, Pose::Identity()}};
    return !lost.NotInPlace(frame, pipeline.map(), asked, {&pixels, 1}).empty();
  };
  for (const double way_m : {0.05, 0.07, 0.09}) {
    for (const double angle_deg : {60.0, 120.0, 180.0, 240.0, 300.0}) {
      SCOPED_TRACE(fmt::format("{} m, {} deg", way_m, angle_deg));
      const Eigen::Vector3d way(way_m * std::cos(angle_deg * kDegree),
                                way_m * std::sin(angle_deg * kDegree), 0);
      const Frame frame = frame_of(kReturns, way, 0.5);
      EXPECT_TRUE(is_lost(frame, frame.mask == kBrick));
    }
  }
  const Frame in_place = frame_of(kReturns, {0, 0, 0}, 0);
  EXPECT_FALSE(is_lost(in_place, in_place.mask == kBrick));
  EXPECT_FALSE(is_lost(in_place, (in_place.mask == kBrick) | (in_place.mask == kTray)));
}

}  // namespace
}  // namespace tsdfpp
