// The tracker `track` in the pipeline: what it follows, what it freezes, and that nothing of what
// is frozen gets into the map.
#include "mapper/track/sdf_tracker.h"

#include <gtest/gtest.h>

#include <limits>

#include "core/units.h"
#include "mapper/pipeline.h"
#include "mapper/voxel_inspection.h"
#include "tests/mapper/toy_scene.h"

namespace tsdfpp {
namespace {

using reference::MakePose;

constexpr int kFrames = 14;
// A pixel sees some 8 mm of these scenes, 0.4 voxel; distances are those of the nearest pixel.
constexpr double kPixel_voxels = 0.4;

Intrinsics Camera() { return {192, 144, 160.0, 160.0, 95.5, 71.5}; }

// The brick slides and turns over the table.
Frame MovingToys(int index) {
  reference::Scene scene = TableOnly();
  AddBrick(scene, 0.3 + 1.0 * kDegree * (index - 1),
           {-0.14 + 0.004 * (index - 1), 0.03, kTableTop_m + 0.045});
  AddTray(scene, -0.4, {0.08, 0.11, kTableTop_m + 0.016});
  return reference::Render(scene, CircleCamera(0.02 * index), index, Camera());
}

std::vector<ObjectInfo> Toys(const std::string& semantic_class = "toy") {
  return {{kBackground, "background", ""},
          {kBrick, "brick", semantic_class},
          {kTray, "tray", semantic_class}};
}

PipelineConfig TrackConfig(Method method = Method::kTsdfppAnchored) {
  PipelineConfig config;
  config.method = method;
  config.map = ToyConfig();
  config.poses = PoseSource::kTrack;
  return config;
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

// What is frozen stays, in pose and in values.
void ExpectFrozen(Pipeline& pipeline, const Frame& frame, const std::vector<InstanceId>& ids) {
  struct Before {
    Pose T_WO;
    std::vector<Eigen::Vector3i> voxels;
    int frozen = 0;
  };
  std::map<InstanceId, Before> before;
  for (const InstanceId id : ids) {
    before[id] = {pipeline.trajectories().at(id).rbegin()->second,
                  VoxelsOf(pipeline.map()).ObservedVoxels(id),
                  pipeline.track_log().objects().at(id).frozen};
  }
  ASSERT_TRUE(pipeline.Process(frame));
  for (const InstanceId id : ids) {
    EXPECT_EQ(pipeline.trajectories().at(id).rbegin()->second.matrix(), before[id].T_WO.matrix());
    EXPECT_EQ(VoxelsOf(pipeline.map()).ObservedVoxels(id), before[id].voxels);
    EXPECT_EQ(pipeline.track_log().objects().at(id).frozen, before[id].frozen + 1);
  }
}

TEST(SdfTracker, FreezesObjectsThatTheMaskSwaps) {
  Pipeline pipeline(TrackConfig(), Toys());
  for (int i = 1; i <= 6; ++i) ASSERT_TRUE(pipeline.Process(MovingToys(i)));
  Frame swapped = MovingToys(7);
  swapped.mask.setTo(99, swapped.mask == kBrick);
  swapped.mask.setTo(kBrick, swapped.mask == kTray);
  swapped.mask.setTo(kTray, swapped.mask == 99);
  ExpectFrozen(pipeline, swapped, {kBrick, kTray});
  // And goes on where they are right again.
  for (int i = 8; i <= kFrames; ++i) ASSERT_TRUE(pipeline.Process(MovingToys(i)));
  EXPECT_EQ(pipeline.track_log().objects().at(kBrick).last, kFrames);
  EXPECT_LT(OffBy_m(pipeline, kBrick, kFrames), kPixel_voxels * kToyVoxel_m);
}

// Of a brick that slides before a camera between its ends only the top and one side are in sight,
// which fit wherever it is. What tells where it is, to the slack, is its outline.
TEST(SdfTracker, FollowsWhatSlidesAlongTheSidesInSight) {
  constexpr double kWay_m = 0.006;  // a frame
  const auto sliding = [&](int index) {
    reference::Scene scene = TableOnly();
    AddBrick(scene, 0.0, {0.0, -0.04 + kWay_m * (index - 1), kTableTop_m + 0.045});
    return reference::Render(scene, CircleCamera(0), index, Camera());
  };
  const auto off_by_m = [&](const SdfTrackConfig& track) {
    PipelineConfig config = TrackConfig();
    config.track = track;
    Pipeline pipeline(config, Toys());
    for (int i = 1; i <= kFrames; ++i) EXPECT_TRUE(pipeline.Process(sliding(i)));
    const Eigen::Vector3d at = sliding(1).T_WO.at(kBrick).translation();
    const Eigen::Vector3d way(0, kWay_m * (kFrames - 1), 0);
    return (pipeline.trajectories().at(kBrick).at(kFrames) * at - at - way).norm();
  };
  SdfTrackConfig without;
  without.outline_weight = 0;
  without.max_seen_through_share = 1;
  // Half a voxel of slack, the pixel that does not count, and the half beside the last one.
  const double slack_voxels = SdfTrackConfig().outline_slack_voxels + 1.5 * kPixel_voxels;
  EXPECT_LT(off_by_m({}), slack_voxels * kToyVoxel_m);
  EXPECT_GT(off_by_m(without), 2 * slack_voxels * kToyVoxel_m) << "the sides tell it alone";
}

// A brick that is suddenly elsewhere: whatever is found, nothing is fused at a wrong place.
TEST(SdfTracker, FreezesWhatTheCameraWouldSeeThrough) {
  // Off by more than this is a wrong pose.
  constexpr double kWrong_voxels = 1;
  const auto turned = [](double turn_rad) {
    reference::Scene scene = TableOnly();
    AddBrick(scene, 0.3 + turn_rad, {-0.1, 0.0, kTableTop_m + 0.045});
    return reference::Render(scene, CircleCamera(0.1), 1, Camera());
  };
  const auto wrongly_fused = [&](double max_seen_through_share) {
    int wrong = 0;
    for (const double turn_rad : {0.5, 0.8, 1.2, 1.5, 2.2}) {
      PipelineConfig config = TrackConfig();
      config.track.max_seen_through_share = max_seen_through_share;
      config.track.outline_weight = 0;
      config.track.max_rotation_rad = 3;
      Pipeline pipeline(config, Toys());
      for (int i = 1; i <= 6; ++i) {
        Frame frame = turned(i < 6 ? 0 : turn_rad);
        frame.index = i;
        EXPECT_TRUE(pipeline.Process(frame));
      }
      const TrackSpan& span = pipeline.track_log().objects().at(kBrick);
      if (span.last < 6) continue;
      const Pose truth = turned(turn_rad).T_WO.at(kBrick) * turned(0).T_WO.at(kBrick).inverse();
      const Eigen::Vector3d corner =
          turned(0).T_WO.at(kBrick) * Eigen::Vector3d(0.075, 0.05, 0.045);
      const Eigen::Vector3d off =
          pipeline.trajectories().at(kBrick).at(6) * corner - truth * corner;
      if (off.norm() > kWrong_voxels * kToyVoxel_m) ++wrong;
    }
    return wrong;
  };
  EXPECT_EQ(wrongly_fused(SdfTrackConfig().max_seen_through_share), 0);
  EXPECT_GT(wrongly_fused(1), 0) << "the other gates do";
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
