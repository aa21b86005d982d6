// A lost object that begins anew on a segment that is not its own gets its model back, where that
// segment is soon out of sight, or where its model fits what is seen of it.
#include <gtest/gtest.h>

#include <vector>

#include "mapper/pipeline.h"
#include "mapper/track/lost_objects.h"
#include "mapper/voxel_inspection.h"
#include "tests/mapper/toy_scene.h"

namespace tsdfpp {
namespace {

using reference::MakePose;

const Eigen::Vector3d kBefore(-0.12, -0.06, kTableTop_m + 0.045);
const Eigen::Vector3d kBeside(0.02, -0.1, kTableTop_m + 0.05);
const Eigen::Vector3d kAfter(0.12, -0.1, kTableTop_m + 0.045);
constexpr double kBeforeYaw_rad = 0.3;
constexpr double kAfterYaw_rad = 1.0;
constexpr double kUnknownYaw_rad = -0.92;  // shows what was not seen, but for the top
constexpr int kBrickFrames = 5;
constexpr int kGoneFrames = 4;
// A pixel sees some 4 mm of these scenes; a flat side is known to less than that.
constexpr double kMost_voxels = 0.5;

// What a frame shows of the brick: a knob says how it stands. The sham is a ball of its colours,
// which the masks say is the brick.
enum class Shown { kBrick, kNothing, kSham, kShamBehindScreen, kUnknownSide, kBrickElsewhere };

Frame FrameOf(int index, Shown shown) {
  reference::Scene scene = TableOnly();
  const Pose T_WC = CircleCamera(0.02 * index);
  if (shown == Shown::kBrick) AddKnobbedBrick(scene, kBeforeYaw_rad, kBefore);
  if (shown == Shown::kUnknownSide) AddKnobbedBrick(scene, kUnknownYaw_rad, kAfter);
  if (shown == Shown::kBrickElsewhere) AddKnobbedBrick(scene, kAfterYaw_rad, kAfter);
  if (shown == Shown::kSham || shown == Shown::kShamBehindScreen) {
    scene.shapes.push_back(reference::Sphere(kBrick, {200, 30, 30}, Eigen::Vector3d::Zero(), 0.05));
    scene.T_WO[kBrick] = MakePose(0, Eigen::Vector3d::UnitZ(), kBeside);
  }
  if (shown == Shown::kShamBehindScreen) {
    scene.shapes.push_back(
        reference::Cuboid(kBall, {30, 30, 200}, Pose::Identity(), {0.08, 0.08, 0.01}));
    scene.T_WO[kBall] = T_WC;
    scene.T_WO[kBall].translation() = (T_WC.translation() + kBeside) / 2;
  }
  AddTray(scene, -0.4, {0.05, 0.14, kTableTop_m + 0.016});
  return reference::Render(scene, T_WC, index, {256, 192, 215.0, 215.0, 127.5, 95.5});
}

class BegunAnew : public testing::Test {
 protected:
  BegunAnew() : pipeline_(Config(), {{kBackground, "background", ""}, {kBrick, "brick", ""}}) {
    Show(Shown::kBrick, kBrickFrames);
    voxels_before_ = Voxels();
    Show(Shown::kNothing, kGoneFrames);
    EXPECT_EQ(Brick().lost, 1);
  }

  static PipelineConfig Config() {
    PipelineConfig config;
    config.map = ToyConfig();
    config.method = Method::kTsdfppAnchored;
    config.associate = AssociationMode::kGiven;
    config.poses = PoseSource::kTrack;
    config.tracked = TrackChoice::kAll;
    return config;
  }

  void Show(Shown shown, int frames) {
    for (int i = 0; i < frames; ++i) ASSERT_TRUE(pipeline_.Process(FrameOf(++frame_, shown)));
  }
  // Until it has begun anew on the sham.
  void BeginOnSham() {
    const int most = SdfTrackConfig{}.return_frames + 3;
    for (int i = 0; i < most && Brick().begun_anew == 0; ++i) Show(Shown::kSham, 1);
    ASSERT_EQ(Brick().begun_anew, 1);
    ASSERT_GT(Voxels(), 0U);
    ASSERT_LT(Voxels(), voxels_before_);
  }

  const TrackSpan& Brick() const { return pipeline_.track_log().objects().at(kBrick); }
  std::size_t Voxels() const { return VoxelsOf(pipeline_.map()).ObservedVoxels(kBrick).size(); }
  double ErrorOfReturned_voxels() const {
    const Pose truth = FrameOf(1, Shown::kBrickElsewhere).T_WO.at(kBrick) *
                       FrameOf(1, Shown::kBrick).T_WO.at(kBrick).inverse();
    const Pose error = truth.inverse() * pipeline_.trajectories().at(kBrick).at(frame_);
    return (error * kBefore - kBefore).norm() / kToyVoxel_m;
  }
  void ExpectFoundWithItsModel() {
    const int found = Brick().found;
    EXPECT_EQ(Voxels(), 0U);
    Show(Shown::kBrickElsewhere, 3);
    EXPECT_EQ(Brick().found, found + 1);
    EXPECT_EQ(Brick().begun_anew, 1);
    EXPECT_GE(Voxels(), voxels_before_);
    ASSERT_TRUE(pipeline_.trajectories().at(kBrick).contains(frame_));
    EXPECT_LT(ErrorOfReturned_voxels(), kMost_voxels);
  }

  Pipeline pipeline_;
  int frame_ = 0;
  std::size_t voxels_before_ = 0;
};

TEST_F(BegunAnew, OnWhatGoesAwayAgain) {
  BeginOnSham();
  Show(Shown::kSham, 2);
  Show(Shown::kNothing, 3);
  EXPECT_EQ(Brick().lost, 2);
  ExpectFoundWithItsModel();
}

// What is hidden is not known to be gone.
TEST_F(BegunAnew, OnWhatIsNotSeenAgain) {
  BeginOnSham();
  Show(Shown::kSham, 2);
  Show(Shown::kShamBehindScreen, SdfTrackConfig{}.return_frames - 1);
  EXPECT_EQ(Brick().lost, 1);
  EXPECT_GT(Voxels(), 0U);
  Show(Shown::kShamBehindScreen, 1);
  EXPECT_EQ(Brick().lost, 2);
  EXPECT_FALSE(pipeline_.trajectories().at(kBrick).contains(frame_));
  ExpectFoundWithItsModel();
}

// Soon after, its own model fits what is seen of it.
TEST_F(BegunAnew, OnItselfWhereItsModelFitsLater) {
  const int most = SdfTrackConfig{}.return_frames + 3;
  for (int i = 0; i < most && Brick().begun_anew == 0; ++i) Show(Shown::kUnknownSide, 1);
  ASSERT_EQ(Brick().begun_anew, 1);
  Show(Shown::kUnknownSide, 2);
  EXPECT_LT(Voxels(), voxels_before_);
  Show(Shown::kBrickElsewhere, 3);
  EXPECT_EQ(Brick().lost, 1);
  EXPECT_EQ(Brick().found, 1);
  EXPECT_EQ(Brick().begun_anew, 1);
  EXPECT_GE(Voxels(), voxels_before_);
  EXPECT_LT(ErrorOfReturned_voxels(), kMost_voxels);
}

// Frames in which no network has looked at anything do not count.
TEST_F(BegunAnew, WaitsForFramesWithLabels) {
  BeginOnSham();
  for (int i = 0; i < 2 * SdfTrackConfig{}.return_frames; ++i) {
    Frame blank = FrameOf(++frame_, Shown::kSham);
    blank.mask.setTo(static_cast<double>(kNoInstance));
    ASSERT_TRUE(pipeline_.Process(blank));
  }
  EXPECT_EQ(Brick().lost, 1);
  EXPECT_GT(Voxels(), 0U);
}

// What has been seen often enough is its model from then on.
TEST_F(BegunAnew, OnWhatStaysInSight) {
  BeginOnSham();
  Show(Shown::kSham, SdfTrackConfig{}.return_frames);
  Show(Shown::kShamBehindScreen, 2 * SdfTrackConfig{}.return_frames);
  EXPECT_EQ(Brick().lost, 1);
  EXPECT_GT(Voxels(), 0U);
  EXPECT_LT(Voxels(), voxels_before_);
}

// What it began anew on is lost and found again in one frame: it has not been seen the longer.
TEST(BegunAnewAlone, IsOnTrialWhereItIsLostAndFoundAtOnce) {
  const Frame frame = FrameOf(1, Shown::kBrick);
  const auto map = MakeMap(Method::kTsdfppAnchored, ToyConfig());
  ObjectPoses T_WO{{kBrick, Pose::Identity()}};
  map->SetObjectPose(kBrick, Pose::Identity());
  map->Fuse(frame, frame.mask);
  const auto voxels = [&] { return VoxelsOf(*map).ObservedVoxels(kBrick).size(); };
  const std::size_t before = voxels();
  LostObjects lost{SdfTrackConfig{}};
  lost.Keep(kBrick, *map, T_WO.at(kBrick));
  ASSERT_TRUE(lost.PutBack({kBrick, 0, Pose::Identity(), true}, *map, T_WO));
  ASSERT_TRUE(lost.TakeOut({kBrick}, *map, T_WO).empty());
  cv::Mat half = frame.mask.clone();
  half(cv::Rect(0, 0, half.cols, half.rows * 45 / 100)).setTo(static_cast<double>(kNoInstance));
  map->Fuse(frame, half);
  const std::size_t begun = voxels();
  ASSERT_GT(begun, 0U);
  ASSERT_LT(begun, before);
  lost.Keep(kBrick, *map, T_WO.at(kBrick));
  ASSERT_TRUE(lost.PutBack({kBrick, 0, Pose::Identity(), false}, *map, T_WO));
  ASSERT_TRUE(lost.TakeOut({kBrick}, *map, T_WO).empty());
  EXPECT_EQ(voxels(), begun);
  lost.Keep(kBrick, *map, T_WO.at(kBrick));
  EXPECT_EQ(lost.TakeOut({}, *map, T_WO), std::vector<InstanceId>{kBrick});
  ASSERT_TRUE(lost.PutBack({kBrick, 0, Pose::Identity(), false}, *map, T_WO));
  EXPECT_EQ(voxels(), before);
}

// A piece of furniture that no network knows may look like it.
TEST(BegunAnewAlone, IsNotOnWhatMayBeginNothing) {
  SdfTrackConfig config;
  const Frame frame = FrameOf(1, Shown::kBrick);
  const auto map = MakeMap(Method::kTsdfppAnchored, ToyConfig());
  map->SetObjectPose(kBrick, Pose::Identity());
  map->Fuse(frame, frame.mask);
  const Frame there = FrameOf(kBrickFrames, Shown::kUnknownSide);
  LostObjects::Segment segment{PixelsByLabel(there.mask, 0).at(kBrick)};
  for (const bool may_begin : {false, true}) {
    segment.may_begin = may_begin;
    LostObjects lost(config);
    lost.Keep(kBrick, *map, Pose::Identity());
    std::size_t returns = 0;
    for (int i = 0; i < 2 * config.return_frames; ++i) {
      const auto found = lost.FindAgain(there, {&segment, 1});
      for (const auto& of : found) EXPECT_TRUE(of.begins_anew);
      returns += found.size();
    }
    EXPECT_EQ(returns > 0, may_begin);
  }
}

}  // namespace
}  // namespace tsdfpp
