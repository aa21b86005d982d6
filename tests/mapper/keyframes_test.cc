// What the tracker's keyframe and its anchor take off where an object turns before the camera.
#include <gtest/gtest.h>

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
