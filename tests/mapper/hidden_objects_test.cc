// What the tracker `track` does with an object of which something hides the most.
#include <gtest/gtest.h>

#include "mapper/pipeline.h"
#include "tests/mapper/noisy_toys.h"
#include "tests/mapper/toy_scene.h"

namespace tsdfpp {
namespace {

// A pixel sees some 2 mm of this scene; distances are those of the nearest pixel. Four of them.
constexpr double kPixels_m = 0.008;

// The brick slides or stands, while a screen comes before it, stays for some frames, and goes.
constexpr InstanceId kScreen = 9;
constexpr int kOpen = 6;     // the last frame without it
constexpr int kHidden = 18;  // the last one with it
Frame BrickBehindScreen(int index, bool moves) {
  reference::Scene scene = TableOnly();
  const Eigen::Vector3d at(-0.14, 0.03 + (moves ? 0.004 * (index - 1) : 0), kTableTop_m + 0.045);
  AddBrick(scene, 0.3, at);
  if (index > kOpen && index <= kHidden) {
    constexpr double kHalf_m = 0.2;
    const Eigen::Vector3d edge = at + Eigen::Vector3d(0.15, 0.005, 0);
    scene.shapes.push_back(reference::Cuboid(
        kScreen, {90, 90, 90},
        reference::MakePose(0, Eigen::Vector3d::UnitZ(), edge - kHalf_m * Eigen::Vector3d::UnitY()),
        {0.005, kHalf_m, 0.15}));
  }
  constexpr double kNoise_m = 0.001;
  return WithNoise(reference::Render(scene, CircleCamera(0.02), index, FineCamera()), kNoise_m);
}

// More than half of it, in all frames with the screen.
TEST(HiddenObjects, TheScreenHidesMoreThanHalf) {
  const auto pixels = [](const Frame& frame) { return cv::countNonZero(frame.mask == kBrick); };
  const int open = pixels(BrickBehindScreen(kOpen, true));
  for (int i = kOpen + 1; i <= kHidden; ++i) {
    const int shown = pixels(BrickBehindScreen(i, true));
    EXPECT_LT(shown, 0.5 * open);
    EXPECT_GT(shown, 0.2 * open);
  }
}

// Frames in which the brick is frozen, of those with the screen; after them it is where it should
// be.
int FrozenBehindScreen(const SdfTrackConfig& track, bool moves) {
  PipelineConfig config;
  config.method = Method::kTsdfppAnchored;
  config.map = ToyConfig();
  config.poses = PoseSource::kTrack;
  config.track = track;
  config.map.voxel_m = kToyVoxel_m / 2;
  Pipeline pipeline(config, {{kBackground, "background", ""}, {kBrick, "brick", "toy"}});
  for (int i = 1; i <= kHidden; ++i) EXPECT_TRUE(pipeline.Process(BrickBehindScreen(i, moves)));
  const int frozen = pipeline.track_log().objects().at(kBrick).frozen;
  for (int i = kHidden + 1; i <= kHidden + 3; ++i) {
    EXPECT_TRUE(pipeline.Process(BrickBehindScreen(i, moves)));
  }
  const TrackSpan& span = pipeline.track_log().objects().at(kBrick);
  EXPECT_EQ(span.frozen, frozen);
  EXPECT_EQ(span.lost, 0);
  const int last = kHidden + 3;
  const Eigen::Vector3d way = BrickBehindScreen(last, moves).T_WO.at(kBrick).translation() -
                              BrickBehindScreen(1, moves).T_WO.at(kBrick).translation();
  const Pose& found = pipeline.trajectories().at(kBrick).at(last);
  const Eigen::Vector3d at = BrickBehindScreen(1, moves).T_WO.at(kBrick).translation();
  EXPECT_LT((found * at - at - way).norm(), kPixels_m);
  return frozen;
}

TEST(HiddenObjects, FreezesWhatMovesAndIsHardlySeen) {
  SdfTrackConfig track;
  track.max_hidden_deviation_voxels = 0.2;  // what is left of a box says that much
  EXPECT_EQ(FrozenBehindScreen(track, true), 0);
  track.max_hidden_deviation_voxels = 0;
  EXPECT_EQ(FrozenBehindScreen(track, true), kHidden - kOpen);
  EXPECT_EQ(FrozenBehindScreen(track, false), 0) << "what rests is known to be where it was";
  track.min_shown_share = 0;
  EXPECT_EQ(FrozenBehindScreen(track, true), 0);
}

}  // namespace
}  // namespace tsdfpp
