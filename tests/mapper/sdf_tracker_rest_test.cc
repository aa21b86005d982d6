// The tracker `track` and objects at rest: what stays there, rests again, or waits for motion.
#include <gtest/gtest.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "mapper/pipeline.h"
#include "mapper/voxel_inspection.h"
#include "tests/mapper/noisy_toys.h"
#include "tests/mapper/toy_scene.h"
#include "tests/mapper/tracked_toys.h"

namespace tsdfpp {
namespace {

// A brick and a tray at rest until frame kStart, seen with noise by a camera that moves; then the
// brick has slid so far.
constexpr int kStart = 10;
// SdfTrackConfig::rest_trend, where it is on.
constexpr double kTrend = 5;
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

TEST(TrackerRest, LeavesAtRestWhatNothingSaysMoves) {
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

TEST(TrackerRest, RestsAgainWhereItStops) {
  constexpr double kFast_m = 0.006;
  constexpr int kStop = kStart + 5;
  // A place of rest_frames ago is one after the stop then, and may be as far off by noise as to be
  // left once more.
  const int kSettled = kStop + 2 * SdfTrackConfig{}.rest_frames;
  const int kLast = kSettled + 10;
  // Of so few points that noise alone moves it by more than a tenth of a voxel a frame.
  constexpr Intrinsics kCoarse{192, 144, 160.0, 160.0, 95.5, 71.5};
  struct Case {
    double voxel_m;
    double noise_m;
  };
  const std::vector<Case> cases{{kToyVoxel_m / 2, 0.004},
                                {kToyVoxel_m / 2.5, 0.004},
                                {kToyVoxel_m / 3, 0.003},
                                {kToyVoxel_m / 3, 0.004}};
  int moved_without = 0;
  for (const auto& [voxel_m, noise_m] : cases) {
    SCOPED_TRACE(fmt::format("voxels of {} m, noise of {} m", voxel_m, noise_m));
    for (const auto& [frames, trend] : {std::pair{0, 0.0}, {4, 0.0}, {4, kTrend}}) {
      PipelineConfig config = TrackConfig();
      config.track.rest_frames = frames;
      config.track.rest_trend = trend;
      config.map.voxel_m = voxel_m;
      Pipeline pipeline(config, Toys());
      int moved = 0;
      for (int i = 1; i <= kLast; ++i) {
        const double slid_m = kFast_m * (std::clamp(i, kStart, kStop) - kStart);
        ASSERT_TRUE(pipeline.Process(NoisyToys(i, slid_m, kCoarse, noise_m)));
        if (i <= kSettled) continue;
        const auto& poses = pipeline.trajectories().at(kBrick);
        moved += poses.at(i).matrix() == poses.at(i - 1).matrix() ? 0 : 1;
      }
      if (frames == 0) {
        moved_without += moved;
        continue;
      }
      EXPECT_EQ(moved, 0);
      const Pose T_WO_first = NoisyToys(1, 0).T_WO.at(kBrick);
      const Pose T_WO = NoisyToys(kLast, kFast_m * (kStop - kStart)).T_WO.at(kBrick);
      const Pose found = pipeline.trajectories().at(kBrick).at(kLast) * T_WO_first;
      EXPECT_LT((found.translation() - T_WO.translation()).norm(), kPixel_voxels * kToyVoxel_m);
    }
  }
  // Without this noise goes on moving it, as it moved before, in more than half of the frames.
  EXPECT_GT(2 * moved_without, static_cast<int>(cases.size()) * (kLast - kSettled));
}

// Where each slope counts, nothing that moved rests again: noise goes on moving it.
TEST(TrackerRest, DoesNotRestWhileItGoesOneWay) {
  constexpr Intrinsics kCoarse{192, 144, 160.0, 160.0, 95.5, 71.5};
  constexpr int kStop = kStart + 5;
  constexpr int kLast = kStop + 20;
  const auto moved_with = [&](double trend) {
    PipelineConfig config = TrackConfig();
    config.track.rest_trend = trend;
    config.map.voxel_m = kToyVoxel_m / 3;
    Pipeline pipeline(config, Toys());
    int moved = 0;
    for (int i = 1; i <= kLast; ++i) {
      const double slid_m = 0.006 * (std::clamp(i, kStart, kStop) - kStart);
      EXPECT_TRUE(pipeline.Process(NoisyToys(i, slid_m, kCoarse, 0.004)));
      if (i <= kStop) continue;
      const auto& poses = pipeline.trajectories().at(kBrick);
      moved += poses.at(i).matrix() == poses.at(i - 1).matrix() ? 0 : 1;
    }
    return moved;
  };
  const int moved = moved_with(0);
  EXPECT_LE(moved, moved_with(kTrend));
  EXPECT_GT(moved_with(1e-9), 2 * moved);
}

// What rests is no excuse for what is not there.
TEST(TrackerRest, FreezesObjectsAtRestThatTheMaskSwaps) {
  Pipeline pipeline(TrackConfig(), Toys());
  for (int i = 1; i < kStart; ++i) ASSERT_TRUE(pipeline.Process(NoisyToys(i, 0)));
  ExpectFrozen(pipeline, WithToysSwapped(NoisyToys(kStart, 0)), {kBrick, kTray});
}

// With --track moving.
PipelineConfig MovingConfig() {
  PipelineConfig config = TrackConfig();
  config.tracked = TrackChoice::kMoving;
  config.map.voxel_m = kToyVoxel_m / 2;
  return config;
}

TEST(TrackerRest, WaitsForMotion) {
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

// Frames that each say that it moved do not make a motion before they say enough together.
TEST(TrackerRest, WaitsForEvidenceInAll) {
  constexpr double kSlide_m = 0.006;
  constexpr double kNeverEnough = 1e5;
  for (const double sum : {0.0, kNeverEnough}) {
    PipelineConfig config = MovingConfig();
    config.track.motion_evidence_sum = sum;
    Pipeline pipeline(config, Toys());
    for (int i = 1; i <= kEnd; ++i) {
      ASSERT_TRUE(pipeline.Process(NoisyToys(i, kSlide_m * std::max(0, i - kStart))));
    }
    EXPECT_EQ(pipeline.track_log().objects().at(kBrick).moved.has_value(), sum == 0) << sum;
  }
}

// A shift of less than a voxel is no motion yet. It is not waited for more of it for ever.
TEST(TrackerRest, WaitsForMotionForSomeFramesAlone) {
  constexpr double kSlid_m = 0.005;
  constexpr int kLongestWait_frames = 20;  // of sdf_tracker_rest.cc
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
TEST(TrackerRest, WhatMovesIsAnObjectWithoutANetwork) {
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

}  // namespace
}  // namespace tsdfpp
