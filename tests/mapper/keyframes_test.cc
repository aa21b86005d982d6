// What the tracker's keyframe and its anchor take off where an object turns before the camera.
#include <gtest/gtest.h>

#include <algorithm>

#include "mapper/pipeline.h"
#include "tests/mapper/noisy_toys.h"
#include "tests/mapper/toy_scene.h"
#include "tests/mapper/tracked_toys.h"

namespace tsdfpp {
namespace {

constexpr int kFrames = 45;
constexpr double kTurn_rad = 0.05;  // a frame

Frame TurningToys(int index) {
  const double turn_rad = kTurn_rad * index;
  reference::Scene scene = TableOnly();
  AddTray(scene, turn_rad, {0.0, 0.03, kTableTop_m + 0.016});
  AddBrick(scene, 0.3 + turn_rad, {-0.14, -0.1, kTableTop_m + 0.045});
  return WithNoise(reference::Render(scene, CircleCamera(0.3), index, FineCamera()), 0.002);
}

// How far the toy's turn is off in the last frame.
double TurnOff_rad(const SdfTrackConfig& track, InstanceId id) {
  PipelineConfig config = TrackConfig();
  config.track = track;
  Pipeline pipeline(config, Toys());
  for (int i = 1; i <= kFrames; ++i) EXPECT_TRUE(pipeline.Process(TurningToys(i)));
  const Pose motion = TurningToys(kFrames).T_WO.at(id) * TurningToys(1).T_WO.at(id).inverse();
  const Pose off = pipeline.trajectories().at(id).at(kFrames) * motion.inverse();
  return Eigen::AngleAxisd(off.linear()).angle();
}

TEST(Keyframes, AnAnchorHoldsWhatTurns) {
  // In 126 degrees it is renewed twice, the keyframe a dozen times: about half of the error is
  // left. Of both toys together, as each one's has chance in it.
  constexpr double kShare = 0.7;
  double anchored = 0;
  double with_keyframe = 0;
  double bare = 0;
  for (const InstanceId id : {kTray, kBrick}) {
    SdfTrackConfig track;
    anchored += TurnOff_rad(track, id);
    track.anchor_turn_rad = 0;
    with_keyframe += TurnOff_rad(track, id);
    track.keyframe_turn_rad = 0;
    track.outline_weight = 0;  // it needs a keyframe
    const double alone = TurnOff_rad(track, id);
    bare += alone;
    track.anchor_turn_rad = SdfTrackConfig{}.anchor_turn_rad;
    EXPECT_EQ(TurnOff_rad(track, id), alone) << "there is no anchor without a keyframe";
  }
  EXPECT_LT(anchored, kShare * with_keyframe);
  EXPECT_LT(with_keyframe, kShare * bare);
}

// A camera that goes around toys at rest; then the brick slides.
constexpr int kAround = 40;
Frame ToysSeenAround(int index, double turn_rad) {
  const double slid_m = 0.004 * std::max(0, index - kAround);
  reference::Scene scene = TableOnly();
  AddTray(scene, -0.4, {0.08, 0.11, kTableTop_m + 0.016});
  AddBrick(scene, 0.3, {-0.14 + slid_m, 0.03, kTableTop_m + 0.045});
  return reference::Render(scene, CircleCamera(turn_rad * std::min(index, kAround)), index,
                           FineCamera());
}

// The farthest that the brick is off.
double OffAround_m(double turn_rad, double voxel_m, double rest_turn_rad) {
  PipelineConfig config = TrackConfig();
  config.map.voxel_m = voxel_m;
  config.track.rest_turn_rad = rest_turn_rad;
  Pipeline pipeline(config, Toys());
  const Pose T_WO_first = ToysSeenAround(1, turn_rad).T_WO.at(kBrick);
  double off_m = 0;
  for (int i = 1; i <= kAround + 8; ++i) {
    const Frame frame = ToysSeenAround(i, turn_rad);
    EXPECT_TRUE(pipeline.Process(frame));
    const Pose found = pipeline.trajectories().at(kBrick).at(i) * T_WO_first;
    off_m = std::max(off_m, (found.translation() - frame.T_WO.at(kBrick).translation()).norm());
  }
  return off_m;
}

// A camera that goes slowly: the first keyframe is kept for 15 frames, and the anchor throughout.
TEST(Keyframes, AreOfTheViewInWhichAnObjectBeginsToMove) {
  constexpr double kSlow_rad = 0.01;  // a frame
  constexpr double kShare = 0.5;
  for (const double voxel_m : {kToyVoxel_m / 2, kToyVoxel_m / 3}) {
    EXPECT_LT(OffAround_m(kSlow_rad, voxel_m, 0.04), kShare * OffAround_m(kSlow_rad, voxel_m, 0));
  }
}

// What never rests never has them made anew.
TEST(Keyframes, AreNotMadeAnewOnceItMoves) {
  SdfTrackConfig track;
  const double off_rad = TurnOff_rad(track, kTray);
  track.rest_turn_rad = 0.01;
  EXPECT_EQ(TurnOff_rad(track, kTray), off_rad);
}

TEST(Keyframes, TheTermOfColourHasNoAnchor) {
  SdfTrackConfig track;
  const double anchored = TurnOff_rad(track, kTray);
  track.colour_weight = 1;
  const double with_colour = TurnOff_rad(track, kTray);
  EXPECT_NE(with_colour, anchored);
  track.anchor_turn_rad = 0;
  EXPECT_EQ(TurnOff_rad(track, kTray), with_colour);
}

}  // namespace
}  // namespace tsdfpp
