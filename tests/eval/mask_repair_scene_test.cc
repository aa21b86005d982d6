// Masks with three times the mild faults on a rendered scene: what the repair leaves wrong of what
// is fused, by the true masks, and what it costs where masks are right.
#include <gtest/gtest.h>

#include <filesystem>

#include "core/intrinsics.h"
#include "mapper/pipeline.h"
#include "sim/load_scene.h"
#include "sim/simulated_source.h"

namespace tsdfpp {
namespace {

constexpr double kImageScale = 0.5;

struct Tally {
  std::int64_t pixels = 0;   // with valid depth
  std::int64_t given = 0;    // of them with a wrong label in the mask
  std::int64_t wrong = 0;    // fused with a wrong label
  std::int64_t waiting = 0;  // not fused
};

Expected<std::unique_ptr<SimulatedSource>> OpenMini(const std::string& sensor) {
  const auto file = std::filesystem::path(TSDFPP_SOURCE_DIR) / "scenes" / "mini.toml";
  TSDFPP_ASSIGN(SceneConfig config, LoadSceneConfig(file));
  config.intrinsics = Scaled(config.intrinsics, kImageScale);
  TSDFPP_ASSIGN(config.sensor, SensorPresetNamed(sensor));
  SimOptions options;
  options.render_colour = false;
  return SimulatedSource::Open(config, options);
}

Expected<Tally> MapMini(const std::string& sensor, MaskRepairMode mode, Method method) {
  TSDFPP_ASSIGN(const auto source, OpenMini(sensor));
  PipelineConfig pipeline_config{.method = method, .mask_repair = mode};
  TSDFPP_RETURN_IF_ERROR(pipeline_config.map.SetProfile("close"));
  TSDFPP_RETURN_IF_ERROR(pipeline_config.Validate());
  Pipeline pipeline(pipeline_config, source->info().objects);
  Tally tally;
  for (int index = 1; index <= source->info().frame_count; ++index) {
    TSDFPP_ASSIGN(const SensedFrame sensed, source->ReadSensed(index));
    Frame frame = sensed.frame;
    frame.colour = cv::Mat::zeros(frame.depth.size(), CV_8UC3);
    TSDFPP_RETURN_IF_ERROR(pipeline.Process(frame));
    for (int v = 0; v < frame.depth.rows; ++v) {
      for (int u = 0; u < frame.depth.cols; ++u) {
        if (!IsValidDepth(frame.depth.at<float>(v, u))) continue;
        const InstanceId truth = sensed.truth.mask.at<InstanceId>(v, u);
        const InstanceId label = pipeline.labels().at<InstanceId>(v, u);
        ++tally.pixels;
        tally.given += frame.mask.at<InstanceId>(v, u) == truth ? 0 : 1;
        tally.waiting += label == kNoInstance ? 1 : 0;
        tally.wrong += label == kNoInstance || label == truth ? 0 : 1;
      }
    }
  }
  fmt::print("{} {} {}: of {} pixels {} given wrong, {} fused wrong, {} waiting\n", sensor,
             MaskRepairModeName(mode), MethodName(method), tally.pixels, tally.given, tally.wrong,
             tally.waiting);
  return tally;
}

class MaskRepairScene : public ::testing::TestWithParam<Method> {};
INSTANTIATE_TEST_SUITE_P(Methods, MaskRepairScene,
                         ::testing::Values(Method::kTsdf, Method::kTsdfpp, Method::kTsdfppAnchored),
                         [](const auto& tested) {
                           std::string name(MethodName(tested.param));
                           std::erase_if(name, [](char c) { return !std::isalnum(c); });
                           return name + std::to_string(static_cast<int>(tested.param));
                         });

// Of what masks say wrongly at most a tenth is fused. In the first three of the 20 frames all
// waits, and then little.
TEST_P(MaskRepairScene, LeavesLittleThatIsWrong) {
  const auto off = MapMini("masks_severe", MaskRepairMode::kOff, GetParam());
  ASSERT_TRUE(off.has_value()) << off.error().message;
  EXPECT_EQ(off->wrong, off->given);
  const auto on = MapMini("masks_severe", MaskRepairMode::kOn, GetParam());
  ASSERT_TRUE(on.has_value()) << on.error().message;
  EXPECT_EQ(on->given, off->given);
  EXPECT_LT(on->wrong, off->wrong / 10);
  EXPECT_LT(on->waiting, on->pixels * 18 / 100);
}

// True masks: at most one pixel in 500 is made wrong.
TEST_P(MaskRepairScene, ChangesLittleThatIsRight) {
  const auto on = MapMini("exact", MaskRepairMode::kOn, GetParam());
  ASSERT_TRUE(on.has_value()) << on.error().message;
  EXPECT_EQ(on->given, 0);
  EXPECT_LT(on->wrong, on->pixels / 500);
}

// A tracker needs a model, which waits to be confirmed, while the car drives.
TEST(MaskRepairTracking, ObjectsAreBornAndThenTracked) {
  const auto source = OpenMini("exact");
  ASSERT_TRUE(source.has_value()) << source.error().message;
  PipelineConfig config{.method = Method::kTsdfppAnchored,
                        .mask_repair = MaskRepairMode::kOn,
                        .poses = PoseSource::kTrack};
  ASSERT_TRUE(config.map.SetProfile("close").has_value());
  ASSERT_TRUE(config.Validate().has_value());
  Pipeline pipeline(config, (*source)->info().objects);
  const int frames = (*source)->info().frame_count;
  for (int index = 1; index <= frames; ++index) {
    Frame frame = (*source)->ReadSensed(index)->frame;
    frame.colour = cv::Mat::zeros(frame.depth.size(), CV_8UC3);
    ASSERT_TRUE(pipeline.Process(frame).has_value());
  }
  const auto objects = pipeline.track_log().objects();
  EXPECT_GT(objects.size(), 0U);
  for (const auto& [id, log] : objects) {
    EXPECT_GE(log.tracked, frames - config.repair.confirm_frames - 1) << id;
  }
}

}  // namespace
}  // namespace tsdfpp
