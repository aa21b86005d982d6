// A car that is tracked through a whole scene, against where the simulator has it.
#include <gtest/gtest.h>

#include "mapper/pipeline.h"
#include "metrics/trajectory.h"
#include "sim/load_scene.h"
#include "sim/simulated_source.h"

namespace tsdfpp {
namespace {

constexpr const char* kScene = TSDFPP_SOURCE_DIR "/scenes/mini.toml";
constexpr InstanceId kCar = 1;
// What the tracker is to reach (docs/tracking.md has 0.3 and 1.1 mm): a twentieth and a fifth of a
// voxel, on a way of 70.
constexpr double kMostExact_m = 0.0005;
constexpr double kMostWithNoise_m = 0.002;
// Turns are less sure in a picture of a third of the size.
constexpr double kMost_deg = 0.8;

// Of the car's origin; its own frame is brought onto the true one in the first frame.
PoseErrors ErrorsOf(bool with_noise, BleedingPixels bleeding) {
  const SceneConfig scene = LoadSceneConfig(kScene).value();
  const SensorConfig sensor = SensorPresetNamed("nguyen2012").value();
  const auto source = SimulatedSource::Open(scene, {}).value();
  const SequenceInfo& info = source->info();
  PipelineConfig config;
  config.method = Method::kTsdfppAnchored;
  config.bleeding = bleeding;
  config.poses = PoseSource::kTrack;
  Pipeline pipeline(config, info.objects);
  Trajectory truth;
  for (int i = 0; i < info.frame_count; ++i) {
    Frame frame = source->ReadTrue(info.first_index + i).value();
    truth[frame.index] = frame.T_WO.at(kCar);
    if (with_noise) {
      EXPECT_TRUE(ApplySensor(sensor, scene.seed, info, frame).has_value());
    }
    EXPECT_TRUE(pipeline.Process(frame).has_value());
  }
  return *PoseErrorsOf(AnchoredAtFirst(PairByFrame(pipeline.trajectories().at(kCar), truth)));
}

TEST(TrackedCar, IsWithinATwentiethOfAVoxelOnExactDepth) {
  const PoseErrors errors = ErrorsOf(false, BleedingPixels::kAuto);
  EXPECT_LT(errors.translation_m.rmse, kMostExact_m);
  EXPECT_LT(errors.rotation_deg.rmse, kMost_deg);
}

TEST(TrackedCar, IsWithinAFifthOfAVoxelWithAKinectsNoise) {
  const PoseErrors errors = ErrorsOf(true, BleedingPixels::kAuto);
  EXPECT_LT(errors.translation_m.rmse, kMostWithNoise_m);
  EXPECT_LT(errors.rotation_deg.rmse, kMost_deg);
}

// It is the pixels that bleed.
TEST(TrackedCar, IsNotWherePixelsThatBleedAreMapped) {
  EXPECT_GT(ErrorsOf(true, BleedingPixels::kKeep).translation_m.rmse, kMostWithNoise_m);
}

}  // namespace
}  // namespace tsdfpp
