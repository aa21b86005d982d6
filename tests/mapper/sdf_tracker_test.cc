// The tracker `track` in the pipeline: what it follows, what it freezes, and that nothing of what
// is frozen gets into the map.
#include "mapper/track/sdf_tracker.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

#include "core/units.h"
#include "mapper/pipeline.h"
#include "mapper/voxel_inspection.h"
#include "tests/mapper/every_method.h"
#include "tests/mapper/noisy_toys.h"
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

// A brick and a tray at rest until frame kStart, seen with noise by a camera that moves; then the
// brick has slid so far.
constexpr int kStart = 10;
Frame NoisyToys(int index, double slid_m, const Intrinsics& camera = FineCamera(),
                double noise_m = 0.002) {
  reference::Scene scene = TableOnly();
  AddBrick(scene, 0.3, {-0.14 + slid_m, 0.03, kTableTop_m + 0.045});
  AddTray(scene, -0.4, {0.08, 0.11, kTableTop_m + 0.016});
  return WithNoise(reference::Render(scene, CircleCamera(0.005 * index), index, camera), noise_m);
}

// Frames kStart + 1 ... kEnd: the largest error of the brick's place.
constexpr int kEnd = kStart + 8;
double FarthestOff_m(Pipeline& pipeline, double slide_m) {
  const Pose T_WO_first = NoisyToys(1, 0).T_WO.at(kBrick);
  double farthest_m = 0;
  for (int i = kStart + 1; i <= kEnd; ++i) {
    const Frame frame = NoisyToys(i, slide_m * (i - kStart));
    EXPECT_TRUE(pipeline.Process(frame));
    const Pose found = pipeline.trajectories().at(kBrick).at(i) * T_WO_first;
    farthest_m =
        std::max(farthest_m, (found.translation() - frame.T_WO.at(kBrick).translation()).norm());
  }
  return farthest_m;
}

TEST(SdfTracker, LeavesAtRestWhatNothingSaysMoves) {
  constexpr double kFast_m = 0.006, kSlow_m = 0.0015;
  for (const double evidence : {0.0, SdfTrackConfig{}.rest_evidence}) {
    for (const double slide_m : {kFast_m, kSlow_m}) {
      SCOPED_TRACE(fmt::format("evidence {}, {} m a frame", evidence, slide_m));
      PipelineConfig config = TrackConfig();
      config.track.rest_evidence = evidence;
      // So fine that noise is more than what is wrong with a model of few voxels.
      config.map.voxel_m = kToyVoxel_m / 2;
      Pipeline pipeline(config, Toys());
      int moved = 0;
      for (int i = 1; i <= kStart; ++i) {
        ASSERT_TRUE(pipeline.Process(NoisyToys(i, 0)));
        for (const InstanceId id : {kBrick, kTray}) {
          const Pose& pose = pipeline.trajectories().at(id).at(i);
          moved += pose.matrix() == Eigen::Matrix4d::Identity() ? 0 : 1;
        }
      }
      // Where no evidence is asked for noise is taken for motion.
      if (evidence > 0) {
        EXPECT_EQ(moved, 0);
      } else {
        EXPECT_GT(moved, kStart);
      }
      EXPECT_LT(FarthestOff_m(pipeline, slide_m), kPixel_voxels * kToyVoxel_m);
      EXPECT_EQ(pipeline.track_log().objects().at(kBrick).frozen, 0);
    }
  }
}

TEST(SdfTracker, RestsAgainWhereItStops) {
  constexpr double kFast_m = 0.006;
  constexpr int kStop = kStart + 5;
  constexpr int kSettled = kStop + 6;
  constexpr int kLast = kSettled + 10;
  // Of so few points that noise alone moves it by more than a tenth of a voxel a frame.
  constexpr Intrinsics kCoarse{256, 192, 214.0, 214.0, 127.5, 95.5};
  constexpr double kFiner = 4;
  constexpr double kNoise_m = 0.004;
  for (const int frames : {0, SdfTrackConfig{}.rest_frames}) {
    PipelineConfig config = TrackConfig();
    config.track.rest_frames = frames;
    config.map.voxel_m = kToyVoxel_m / kFiner;
    Pipeline pipeline(config, Toys());
    int moved = 0;
    for (int i = 1; i <= kLast; ++i) {
      const double slid_m = kFast_m * (std::clamp(i, kStart, kStop) - kStart);
      ASSERT_TRUE(pipeline.Process(NoisyToys(i, slid_m, kCoarse, kNoise_m)));
      if (i <= kSettled) continue;
      const auto& poses = pipeline.trajectories().at(kBrick);
      moved += poses.at(i).matrix() == poses.at(i - 1).matrix() ? 0 : 1;
    }
    // Else noise moves it for ever, as it moved before.
    EXPECT_EQ(moved, frames > 0 ? 0 : kLast - kSettled) << frames;
    const Pose T_WO_first = NoisyToys(1, 0).T_WO.at(kBrick);
    const Pose T_WO = NoisyToys(kLast, kFast_m * (kStop - kStart)).T_WO.at(kBrick);
    const Pose found = pipeline.trajectories().at(kBrick).at(kLast) * T_WO_first;
    EXPECT_LT((found.translation() - T_WO.translation()).norm(), kPixel_voxels * kToyVoxel_m);
  }
}

// What rests is no excuse for what is not there.
TEST(SdfTracker, FreezesObjectsAtRestThatTheMaskSwaps) {
  Pipeline pipeline(TrackConfig(), Toys());
  for (int i = 1; i < kStart; ++i) ASSERT_TRUE(pipeline.Process(NoisyToys(i, 0)));
  Frame swapped = NoisyToys(kStart, 0);
  swapped.mask.setTo(99, swapped.mask == kBrick);
  swapped.mask.setTo(kBrick, swapped.mask == kTray);
  swapped.mask.setTo(kTray, swapped.mask == 99);
  ExpectFrozen(pipeline, swapped, {kBrick, kTray});
}

// With --track moving.
PipelineConfig MovingConfig() {
  PipelineConfig config = TrackConfig();
  config.tracked = TrackChoice::kMoving;
  config.map.voxel_m = kToyVoxel_m / 2;
  return config;
}

TEST(SdfTracker, WaitsForMotion) {
  constexpr double kSlide_m = 0.006;  // a frame; two are more than a voxel
  const PipelineConfig config = MovingConfig();
  Pipeline pipeline(config, Toys());
  for (int i = 1; i <= kStart; ++i) ASSERT_TRUE(pipeline.Process(NoisyToys(i, 0)));
  const auto& objects = pipeline.track_log().objects();
  EXPECT_FALSE(objects.at(kBrick).moved);
  const std::size_t before = VoxelsOf(pipeline.map()).ObservedVoxels(kBrick).size();
  const Pose T_WO_first = NoisyToys(1, 0).T_WO.at(kBrick);
  for (int i = kStart + 1; i <= kEnd; ++i) {
    SCOPED_TRACE(i);
    const Frame frame = NoisyToys(i, kSlide_m * (i - kStart));
    ASSERT_TRUE(pipeline.Process(frame));
    const Pose pose = pipeline.trajectories().at(kBrick).at(i);
    if (!objects.at(kBrick).moved) {
      EXPECT_EQ(pose.matrix(), Eigen::Matrix4d::Identity());
      continue;
    }
    const Pose found = pose * T_WO_first;
    EXPECT_LT((found.translation() - frame.T_WO.at(kBrick).translation()).norm(),
              kPixel_voxels * kToyVoxel_m);
  }
  ASSERT_TRUE(objects.at(kBrick).moved);
  EXPECT_LE(*objects.at(kBrick).moved, kStart + 1 + config.track.motion_frames);
  EXPECT_GE(VoxelsOf(pipeline.map()).ObservedVoxels(kBrick).size(), before);
  EXPECT_FALSE(objects.at(kTray).moved);
}

// A shift of less than a voxel is no motion yet. It is not waited for more of it for ever.
TEST(SdfTracker, WaitsForMotionForSomeFramesAlone) {
  constexpr double kSlid_m = 0.005;
  constexpr int kLongestWait_frames = 20;  // of sdf_tracker.cc
  Pipeline pipeline(MovingConfig(), Toys());
  for (int i = 1; i <= kStart; ++i) ASSERT_TRUE(pipeline.Process(NoisyToys(i, 0)));
  for (int i = 1; i <= kLongestWait_frames + 1; ++i) {
    ASSERT_TRUE(pipeline.Process(NoisyToys(kStart + i, kSlid_m)));
  }
  const TrackSpan& brick = pipeline.track_log().objects().at(kBrick);
  EXPECT_FALSE(brick.moved);
  EXPECT_EQ(brick.frozen, kLongestWait_frames);
  EXPECT_EQ(brick.last, kStart + kLongestWait_frames + 1);
  EXPECT_EQ(pipeline.trajectories().at(kBrick).rbegin()->second.matrix(),
            Eigen::Matrix4d::Identity());
}

// A network that knows trays alone.
class TrayFinder : public InstanceFinder {
 public:
  Expected<std::vector<Instance>> Find(const Frame& frame) override {
    const cv::Mat mask = NoisyToys(frame.index, SlidAt(frame.index)).mask == kTray;
    return std::vector<Instance>{{cv::Rect({}, mask.size()), mask, "tray", 1}};
  }
  static double SlidAt(int index) { return 0.006 * std::max(0, index - kStart); }
};

// What no network knows, but moves, is tracked from then on, as a whole.
TEST(SdfTracker, WhatMovesIsAnObjectWithoutANetwork) {
  PipelineConfig config = MovingConfig();
  config.segmentation = Segmentation::kFull;
  config.segmenter.finder = std::make_shared<TrayFinder>();
  config.segmenter.network.unknown_objects = true;
  config.associate = AssociationMode::kVotes;
  ASSERT_TRUE(config.Validate());
  Pipeline pipeline(config, {});
  cv::Mat brick;
  for (int i = 1; i <= kEnd; ++i) {
    Frame frame = NoisyToys(i, TrayFinder::SlidAt(i));
    brick = frame.mask == kBrick;
    frame.mask = cv::Mat();
    frame.T_WO.clear();
    ASSERT_TRUE(pipeline.Process(frame));
  }
  std::map<InstanceId, int> moved;  // pixels of those that have, on the brick
  for (const auto& [id, span] : pipeline.track_log().objects()) {
    if (span.moved) {
      moved[id] = cv::countNonZero((pipeline.labels() == static_cast<double>(id)) & brick);
    }
  }
  ASSERT_EQ(moved.size(), 1U);
  EXPECT_GT(2 * moved.begin()->second, cv::countNonZero(brick));
  const InstanceId id = moved.begin()->first;
  const Pose& pose = pipeline.trajectories().at(id).at(kEnd);
  EXPECT_LT((pose.translation() - Eigen::Vector3d(TrayFinder::SlidAt(kEnd), 0, 0)).norm(),
            kPixel_voxels * kToyVoxel_m);
  std::map<InstanceId, std::string> classes;
  for (const ObjectInfo& object : pipeline.Objects()) classes[object.id] = object.semantic_class;
  EXPECT_EQ(classes.at(id), "");
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
