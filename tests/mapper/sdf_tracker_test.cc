// The tracker `track` in the pipeline: what it follows, what it freezes, and that nothing of what
// is frozen gets into the map.
#include "mapper/track/sdf_tracker.h"

#include <gtest/gtest.h>

#include <limits>

#include "core/units.h"
#include "mapper/map_file.h"
#include "mapper/pipeline.h"
#include "mapper/voxel_inspection.h"
#include "tests/mapper/every_method.h"
#include "tests/mapper/toy_scene.h"
#include "tests/mapper/tracked_toys.h"

namespace tsdfpp {
namespace {

using reference::MakePose;

constexpr int kFrames = 14;
Intrinsics Camera() { return {192, 144, 160.0, 160.0, 95.5, 71.5}; }

// The brick slides and turns over the table.
Frame MovingToys(int index) {
  reference::Scene scene = TableOnly();
  AddBrick(scene, 0.3 + 1.0 * kDegree * (index - 1),
           {-0.14 + 0.004 * (index - 1), 0.03, kTableTop_m + 0.045});
  AddTray(scene, -0.4, {0.08, 0.11, kTableTop_m + 0.016});
  return reference::Render(scene, CircleCamera(0.02 * index), index, Camera());
}

double OffBy_m(const Pipeline& pipeline, InstanceId id, int frame) {
  const Pose truth = MovingToys(frame).T_WO.at(id) * MovingToys(1).T_WO.at(id).inverse();
  const Pose& found = pipeline.trajectories().at(id).at(frame);
  const Eigen::Vector3d at = MovingToys(1).T_WO.at(id).translation();
  return (found * at - truth * at).norm();
}

TEST(SdfTracker, FollowsAMovingObject) {
  for (const Method method : {Method::kTsdfppAnchored, Method::kTsdfpp}) {
    SCOPED_TRACE(MethodName(method));
    Pipeline pipeline(TrackConfig(method), Toys());
    for (int i = 1; i <= kFrames; ++i) ASSERT_TRUE(pipeline.Process(MovingToys(i)));
    EXPECT_LT(OffBy_m(pipeline, kBrick, kFrames), kPixel_voxels * kToyVoxel_m);
    // Of tsdf++ the tray, less than two voxels thick, does not survive being resampled.
    if (method == Method::kTsdfppAnchored) {
      EXPECT_LT(OffBy_m(pipeline, kTray, kFrames), kPixel_voxels * kToyVoxel_m);
    }
    const TrackSpan& span = pipeline.track_log().objects().at(kBrick);
    EXPECT_EQ(span.first, 1);
    EXPECT_EQ(span.last, kFrames);
    EXPECT_EQ(span.tracked, kFrames - 1);
    EXPECT_EQ(span.frozen, 0);
    EXPECT_TRUE(pipeline.Remarks().empty());
  }
}

// One that was removed before the map was saved is seen again: its poses have one origin.
TEST(SdfTracker, GoesOnFromTheLastPoseOfWhatTheMapHasNoMore) {
  Pipeline before(TrackConfig(), Toys());
  for (int i = 1; i <= 8; ++i) ASSERT_TRUE(before.Process(MovingToys(i)));
  const Pose last = before.trajectories().at(kBrick).at(8);
  ASSERT_GT(last.translation().norm(), kToyVoxel_m);
  const auto removed = before.map().Clone();
  removed->Remove(kBrick);
  auto file = MapFromBytes(MapToBytes(*removed).value(), "map.tsdf");
  ASSERT_TRUE(file.has_value());
  Pipeline pipeline(TrackConfig(), Toys(), std::move(file->map), before.trajectories());
  // As long as it is not seen it is nowhere.
  Frame hidden = MovingToys(9);
  hidden.depth.setTo(0, hidden.mask == kBrick);
  ASSERT_TRUE(pipeline.Process(hidden));
  EXPECT_FALSE(pipeline.trajectories().at(kBrick).contains(9));
  ASSERT_TRUE(pipeline.Process(MovingToys(10)));
  EXPECT_EQ(pipeline.trajectories().at(kBrick).at(10).matrix(), last.matrix());
  for (int i = 11; i <= kFrames; ++i) ASSERT_TRUE(pipeline.Process(MovingToys(i)));
  const Pose truth =
      MovingToys(kFrames).T_WO.at(kBrick) * MovingToys(10).T_WO.at(kBrick).inverse() * last;
  const Eigen::Vector3d at = MovingToys(1).T_WO.at(kBrick).translation();
  const Pose& found = pipeline.trajectories().at(kBrick).at(kFrames);
  EXPECT_LT((found * at - truth * at).norm(), kPixel_voxels * kToyVoxel_m);
}

TEST(SdfTracker, FreezesObjectsThatTheMaskSwaps) {
  Pipeline pipeline(TrackConfig(), Toys());
  for (int i = 1; i <= 6; ++i) ASSERT_TRUE(pipeline.Process(MovingToys(i)));
  ExpectFrozen(pipeline, WithToysSwapped(MovingToys(7)), {kBrick, kTray});
  // And goes on where they are right again.
  for (int i = 8; i <= kFrames; ++i) ASSERT_TRUE(pipeline.Process(MovingToys(i)));
  EXPECT_EQ(pipeline.track_log().objects().at(kBrick).last, kFrames);
  EXPECT_LT(OffBy_m(pipeline, kBrick, kFrames), kPixel_voxels * kToyVoxel_m);
}

TEST(SdfTracker, FreezesWhatIsTooSmallOrWithoutDepth) {
  Pipeline pipeline(TrackConfig(), Toys());
  for (int i = 1; i <= 4; ++i) ASSERT_TRUE(pipeline.Process(MovingToys(i)));
  Frame pixel = MovingToys(5);
  const cv::Mat brick = pixel.mask == kBrick;
  cv::Point somewhere;
  cv::minMaxLoc(brick, nullptr, nullptr, nullptr, &somewhere);
  pixel.mask.setTo(kNoInstance, brick);
  pixel.mask.at<std::uint16_t>(somewhere) = kBrick;
  ExpectFrozen(pipeline, pixel, {kBrick});
  for (const float depth : {0.0F, std::numeric_limits<float>::quiet_NaN()}) {
    Frame blind = MovingToys(6);
    blind.depth.setTo(depth, blind.mask == kBrick);
    ExpectFrozen(pipeline, blind, {kBrick});
  }
}

// It has no pose, and nothing of it is in the map, until there is enough of it.
TEST(SdfTracker, BeginsAnObjectOnceItIsLargeEnough) {
  Pipeline pipeline(TrackConfig(), Toys());
  Frame first = MovingToys(1);
  const cv::Mat brick = first.mask == kBrick;
  cv::Point somewhere;
  cv::minMaxLoc(brick, nullptr, nullptr, nullptr, &somewhere);
  first.mask.setTo(kNoInstance, brick);
  first.mask.at<std::uint16_t>(somewhere) = kBrick;
  ASSERT_TRUE(pipeline.Process(first));
  EXPECT_FALSE(pipeline.trajectories().contains(kBrick));
  EXPECT_TRUE(VoxelsOf(pipeline.map()).ObservedVoxels(kBrick).empty());
  ASSERT_TRUE(pipeline.Process(MovingToys(2)));
  EXPECT_EQ(pipeline.trajectories().at(kBrick).at(2).matrix(), Pose::Identity().matrix());
}

// An object that began anew somewhere, and is then put back with the model that it had: what was
// seen of the other one says nothing of this, and would draw it away.
TEST(SdfTracker, ForgetsAnotherModelWhereAnObjectIsPlaced) {
  constexpr int kPlaced = 8;
  const auto map = MakeMap(Method::kTsdfppAnchored, ToyConfig());
  for (int i = 1; i <= 4; ++i) SetPosesThenFuse(*map, MovingToys(i));
  const Frame begun = MovingToys(4);
  const auto nothing = MakeMap(Method::kTsdfppAnchored, ToyConfig());
  Pose elsewhere = begun.T_WO.at(kBrick);
  elsewhere.translation().x() += 2 * kToyVoxel_m;
  const Frame frame = MovingToys(kPlaced);
  const auto off_voxels = [&](PlacedModel model) {
    SdfTracker tracker(SdfTrackConfig{});
    const auto first = tracker.Track(begun, begun.mask, *nothing, {{kBrick, elsewhere}});
    EXPECT_EQ(first.seen.at(kBrick), TrackStatus::kBegun);
    tracker.Place(kBrick, kPlaced, model);
    const auto found = tracker.Track(frame, frame.mask, *map, {{kBrick, begun.T_WO.at(kBrick)}});
    EXPECT_EQ(found.seen.at(kBrick), TrackStatus::kTracked);
    const Pose& T_WO = found.T_WO.at(kBrick);
    return (T_WO.translation() - frame.T_WO.at(kBrick).translation()).norm() / kToyVoxel_m;
  };
  EXPECT_LT(off_voxels(PlacedModel::kOther), kPixel_voxels);
  EXPECT_GT(off_voxels(PlacedModel::kSame), kPixel_voxels) << "what was seen of its model counts";
}

TEST(SdfTracker, TellsAnObjectFromItsTwinBesideIt) {
  const auto twins = [](int index) {
    reference::Scene scene = TableOnly();
    AddBrick(scene, 0.0, {-0.075 + 0.003 * (index - 1), 0.0, kTableTop_m + 0.045});
    scene.shapes.push_back(
        reference::Cuboid(kTray, {30, 180, 30}, Pose::Identity(), {0.075, 0.05, 0.045}));
    scene.T_WO[kTray] = MakePose(0, Eigen::Vector3d::UnitZ(),
                                 {-0.075 + 0.003 * (index - 1), -0.1, kTableTop_m + 0.045});
    return reference::Render(scene, CircleCamera(-0.9 + 0.02 * index), index, Camera());
  };
  Pipeline pipeline(TrackConfig(), Toys());
  for (int i = 1; i <= kFrames; ++i) ASSERT_TRUE(pipeline.Process(twins(i)));
  const Eigen::Vector3d way(0.003 * (kFrames - 1), 0, 0);
  for (const InstanceId id : {kBrick, kTray}) {
    const Eigen::Vector3d at = twins(1).T_WO.at(id).translation();
    const Pose& found = pipeline.trajectories().at(id).at(kFrames);
    EXPECT_LT((found * at - at - way).norm(), kPixel_voxels * kToyVoxel_m) << id;
  }
}

TEST(SdfTracker, TracksAllWhereNoClassIsKnownAndSaysWhereItTracksNothing) {
  const TrackedObjects unclassified(TrackChoice::kAuto, Toys(""));
  EXPECT_EQ(unclassified.choice(), TrackChoice::kAll);
  EXPECT_TRUE(unclassified.Contains(kBrick));
  EXPECT_TRUE(unclassified.Contains(77)) << "whoever finds objects may invent ids";
  EXPECT_FALSE(unclassified.Contains(kBackground));
  EXPECT_FALSE(unclassified.Contains(kNoInstance));
  const TrackedObjects classified(TrackChoice::kAuto, Toys());
  EXPECT_EQ(classified.choice(), TrackChoice::kClassified);
  EXPECT_TRUE(classified.Contains(kTray));
  EXPECT_FALSE(classified.Contains(77));

  PipelineConfig config = TrackConfig();
  config.tracked = TrackChoice::kClassified;
  Pipeline pipeline(config, Toys(""));
  for (int i = 1; i <= 2; ++i) ASSERT_TRUE(pipeline.Process(MovingToys(i)));
  EXPECT_TRUE(pipeline.trajectories().empty());
  ASSERT_EQ(pipeline.Remarks().size(), 1U);
  EXPECT_NE(pipeline.Remarks()[0].find("--poses track"), std::string::npos);
}

// A single frame begins objects, and registers none.
TEST(SdfTracker, SaysHowManyWereThereAndNotRegistered) {
  std::vector<ObjectInfo> objects = Toys();
  const auto remarks = [&] {
    Pipeline pipeline(TrackConfig(), objects);
    EXPECT_TRUE(pipeline.Process(MovingToys(1)));
    return pipeline.Remarks();
  };
  const std::string begin = "objects were to be tracked (--poses track) and none was: frames show ";
  EXPECT_EQ(remarks(), std::vector{begin + "2 objects with a class, and none could be registered"});
  objects.back().semantic_class.clear();
  EXPECT_EQ(remarks(), std::vector{begin + "1 object with a class, and none could be registered"});
}

// Each id there is, each all over the image: some minutes a frame where the image is looked at once
// for each.
TEST(ManyObjects, AreLookedAtTogether) {
  Frame frame;
  frame.intrinsics = {320, 240, 250, 250, 159.5, 119.5};
  frame.colour = cv::Mat::zeros(240, 320, CV_8UC3);
  frame.depth = cv::Mat::ones(240, 320, CV_32FC1);
  frame.mask = cv::Mat(240, 320, CV_16UC1);
  for (int at = 0; at < 240 * 320; ++at) {
    frame.mask.at<InstanceId>(at / 320, at % 320) =
        static_cast<InstanceId>(1 + at % (kNoInstance - 1));
  }
  for (const PoseSource poses : {PoseSource::kIcp, PoseSource::kTrack}) {
    PipelineConfig config;
    config.method = Method::kTsdfppAnchored;
    config.map.voxel_m = 0.1;
    config.poses = poses;
    Pipeline pipeline(config, {});
    ASSERT_TRUE(pipeline.Process(frame));
    EXPECT_EQ(pipeline.track_log().objects().size(), std::size_t{kNoInstance} - 1);
  }
}

}  // namespace
}  // namespace tsdfpp
