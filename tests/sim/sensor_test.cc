// The whole sensor on a frame: exactness, reproducibility, and what it refuses.
#include "sim/sensor/sensor.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include "core/pose_text.h"
#include "tests/sim/sensor_images.h"

namespace tsdfpp {
namespace {

constexpr std::uint64_t kSensorSeed = 41;

SequenceInfo ToyInfo() {
  SequenceInfo info;
  info.name = "toy";
  info.objects = {{0, "background", ""}, {1, "ball", "ball"}, {2, "globe", "globe"}};
  return info;
}

// Every fault at once, but for the shutter.
SensorConfig Everything(DepthModel model) {
  SensorConfig config = SensorPresetNamed("kinect").value();
  config.depth.model = model;
  config.depth.flying_pixel_rate = 0.5;
  config.depth.dropout_range_start_m = 1;
  config.depth.dropout_range_end_m = 5;
  config.depth.unit_m = 0.001;
  config.colour = SensorPresetNamed("colour_noise").value().colour;
  config.camera_pose = SensorPresetNamed("pose_drift").value().camera_pose;
  config.masks = SensorPresetNamed("masks_severe").value().masks;
  return config;
}

struct Sensed {
  Frame frame;
  SensedTruth truth;
};

Sensed Apply(const SensorConfig& config, int index, std::uint64_t seed = kSensorSeed) {
  Sensed sensed{ToyFrame(index), {}};
  auto truth = ApplySensor(config, seed, ToyInfo(), sensed.frame);
  EXPECT_TRUE(truth.has_value()) << truth.error().message;
  sensed.truth = std::move(truth.value());
  return sensed;
}

bool SameFrame(const Frame& a, const Frame& b) {
  return SameBytes(a.colour, b.colour) && SameBytes(a.depth, b.depth) &&
         SameBytes(a.mask, b.mask) && a.T_WC.matrix() == b.T_WC.matrix();
}

std::vector<SensorConfig> AllConfigs() {
  std::vector<SensorConfig> configs;
  for (const SensorPreset& preset : SensorPresets()) configs.push_back(preset.config);
  for (std::size_t i = 0; i < DepthModelNames().size(); ++i) {
    configs.push_back(Everything(static_cast<DepthModel>(i)));
  }
  return configs;
}

TEST(Sensor, ExactChangesNoByte) {
  const Sensed sensed = Apply({}, 7);
  EXPECT_TRUE(SameFrame(sensed.frame, ToyFrame(7)));
  EXPECT_EQ(sensed.truth.segments.size(), 2U);
}

TEST(Sensor, EveryOtherPresetChangesAFrame) {
  for (const SensorPreset& preset : SensorPresets()) {
    bool changes = false;
    for (int index = 2; index < 8; ++index) {
      changes = changes || !SameFrame(Apply(preset.config, index).frame, ToyFrame(index));
    }
    EXPECT_EQ(changes, preset.name != "exact") << preset.name;
  }
}

TEST(Sensor, KeepsTheTruth) {
  for (const SensorConfig& config : AllConfigs()) {
    const Sensed sensed = Apply(config, 9);
    const Frame truth = ToyFrame(9);
    EXPECT_TRUE(SameBytes(sensed.truth.colour, truth.colour));
    EXPECT_TRUE(SameBytes(sensed.truth.depth, truth.depth));
    EXPECT_TRUE(SameBytes(sensed.truth.mask, truth.mask));
    EXPECT_EQ(sensed.truth.T_WC.matrix(), truth.T_WC.matrix());
    EXPECT_EQ(sensed.frame.index, 9);
  }
}

TEST(Sensor, AFrameAloneIsTheSameAsInASequence) {
  for (const SensorConfig& config : AllConfigs()) {
    const Sensed alone = Apply(config, 12);
    for (int index = 1; index < 12; ++index) Apply(config, index);
    const Sensed in_sequence = Apply(config, 12);
    EXPECT_TRUE(SameFrame(alone.frame, in_sequence.frame));
    EXPECT_EQ(alone.truth.segments, in_sequence.truth.segments);
  }
}

TEST(Sensor, AnyNumberOfThreadsGivesTheSameBytes) {
  for (const SensorConfig& config : AllConfigs()) {
    Sensed one;
    {
      const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, 1);
      one = Apply(config, 5);
    }
    Sensed many;
    {
      const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, 8);
      tbb::task_arena(8).execute([&] { many = Apply(config, 5); });
    }
    EXPECT_TRUE(SameFrame(one.frame, many.frame));
    EXPECT_EQ(one.truth.segments, many.truth.segments);
  }
}

TEST(Sensor, SeedAndFrameMatter) {
  const SensorConfig config = Everything(DepthModel::kNguyen2012);
  const Sensed sensed = Apply(config, 5);
  const Sensed other_seed = Apply(config, 5, kSensorSeed + 1);
  const Sensed other_frame = Apply(config, 6);
  for (const Sensed* other : {&other_seed, &other_frame}) {
    EXPECT_FALSE(SameBytes(sensed.frame.depth, other->frame.depth));
    EXPECT_FALSE(SameBytes(sensed.frame.colour, other->frame.colour));
    EXPECT_NE(sensed.frame.T_WC.matrix(), other->frame.T_WC.matrix());
  }
}

// One fault draws the same numbers whether or not others are on.
TEST(Sensor, FaultsDoNotDisturbEachOther) {
  SensorConfig depth;
  depth.depth.model = DepthModel::kD435;
  SensorConfig more = Everything(DepthModel::kD435);
  more.depth = depth.depth;
  EXPECT_TRUE(SameBytes(Apply(depth, 5).frame.depth, Apply(more, 5).frame.depth));
  SensorConfig pose;
  pose.camera_pose = more.camera_pose;
  EXPECT_EQ(Apply(pose, 5).frame.T_WC.matrix(), Apply(more, 5).frame.T_WC.matrix());
}

TEST(Sensor, GivenPosesAreAFixedPointOfTheirText) {
  const Pose given = Apply(SensorPresetNamed("pose_drift").value(), 20).frame.T_WC;
  EXPECT_EQ(PoseThroughText(given).matrix(), given.matrix());
}

TEST(Sensor, RefusesWhatItCannotDo) {
  const auto fault = [](const SensorConfig& config, Frame frame, const SequenceInfo& info) {
    const auto truth = ApplySensor(config, kSensorSeed, info, frame);
    EXPECT_FALSE(truth.has_value());
    EXPECT_EQ(truth.error().kind, ErrorKind::kUsage);
    return truth.error().message;
  };
  SensorConfig wrong;
  wrong.depth.unit_m = -1;
  EXPECT_EQ(fault(wrong, ToyFrame(), ToyInfo()), "'sensor.depth.unit_m' is -1, expected 0 to 1");
  Frame no_colour = ToyFrame(3);
  no_colour.colour = cv::Mat();
  EXPECT_EQ(
      fault(SensorPresetNamed("azure").value(), no_colour, ToyInfo()),
      "the depth model 'azure' needs colour images (dark surfaces give no depth), and frame 3 "
      "has none");
  Frame no_mask = ToyFrame(3);
  no_mask.mask = cv::Mat();
  EXPECT_EQ(fault(SensorPresetNamed("masks_mild").value(), no_mask, ToyInfo()),
            "sensor.masks asks for mask faults, and frame 3 of 'toy' has no mask");
  SequenceInfo many = ToyInfo();
  many.objects.push_back({130, "cup", "cup"});
  EXPECT_EQ(
      fault(SensorPresetNamed("masks_mild").value(), ToyFrame(), many),
      "sensor.masks.split and .flicker use the ids from 128 on, and object 'cup' of 'toy' has "
      "id 130: expected ids below 128");
}

// A frame with 100 objects, each a square of its own.
Frame ManySquares(SequenceInfo& info) {
  Frame frame = ToyFrame(3);
  frame.mask = cv::Mat::zeros(frame.depth.size(), CV_16UC1);
  const int in_a_row = frame.depth.cols / 4;
  info.objects = {{kBackground, "background", ""}};
  for (int id = 1; id <= 100; ++id) {
    const cv::Rect square(4 * ((id - 1) % in_a_row), 4 * ((id - 1) / in_a_row), 3, 3);
    frame.mask(square).setTo(id);
    info.objects.push_back({static_cast<InstanceId>(id), "cup", "cup"});
  }
  return frame;
}

// Either kind alone has an id for each; both together would not.
TEST(Sensor, FaultsInventNoMoreIdsThanThereAre) {
  SequenceInfo info = ToyInfo();
  const Frame frame = ManySquares(info);
  ASSERT_EQ(cv::countNonZero(frame.mask), 100 * 9);
  SensorConfig config;
  config.masks.split = {1, 1};
  Frame split = frame;
  const auto truth = ApplySensor(config, kSensorSeed, info, split);
  ASSERT_TRUE(truth.has_value());
  EXPECT_EQ(truth->segments.size(), 200U);
  config.masks.flicker = {1, 1};
  Frame both = frame;
  const auto refused = ApplySensor(config, kSensorSeed, info, both);
  ASSERT_FALSE(refused.has_value());
  EXPECT_EQ(refused.error().kind, ErrorKind::kUsage);
  EXPECT_EQ(refused.error().message,
            "sensor.masks.split and .flicker may invent 200 ids for the 100 objects of 'toy', "
            "expected at most 128");
}

TEST(Sensor, AMissingMaskIsNoFaultWithoutMaskFaults) {
  Frame frame = ToyFrame(3);
  frame.mask = cv::Mat();
  const auto truth = ApplySensor(SensorPresetNamed("d435").value(), kSensorSeed, ToyInfo(), frame);
  ASSERT_TRUE(truth.has_value());
  EXPECT_TRUE(frame.mask.empty());
  EXPECT_TRUE(truth->segments.empty());
}

}  // namespace
}  // namespace tsdfpp
