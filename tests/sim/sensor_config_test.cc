// The sensor's TOML: round trips, and the sentence for each way to get it wrong.
#include "sim/config/sensor_config.h"

#include <gtest/gtest.h>

#include "core/toml_reader.h"

namespace tsdfpp {
namespace {

Expected<SensorConfig> Read(const std::string& text) {
  const auto root = ParseToml(text, "s.toml");
  if (!root) return tl::unexpected(root.error());
  const toml::table* table = (*root)["sensor"].as_table();
  EXPECT_NE(table, nullptr);
  return ReadSensorConfig(*table, "s.toml");
}

std::string FaultOf(const std::string& text) {
  const auto config = Read(text);
  if (config) return "no fault";
  EXPECT_EQ(config.error().kind, ErrorKind::kUsage);
  return config.error().message;
}

TEST(SensorConfig, EmptyIsExact) {
  const auto config = Read("[sensor]");
  ASSERT_TRUE(config.has_value());
  EXPECT_EQ(*config, SensorConfig{});
  EXPECT_EQ(DescribeSensor(*config), "exact");
}

TEST(SensorConfig, EveryPresetIsValidAndReadsBack) {
  EXPECT_EQ(SensorPresets().front().name, "exact");
  EXPECT_EQ(SensorPresets().front().config, SensorConfig{});
  for (const SensorPreset& preset : SensorPresets()) {
    EXPECT_TRUE(ValidateSensorConfig(preset.config).has_value()) << preset.name;
    const auto again = Read(SensorConfigToToml(preset.config));
    ASSERT_TRUE(again.has_value()) << preset.name << again.error().message;
    EXPECT_EQ(*again, preset.config) << preset.name;
    const auto named = Read("[sensor]\npreset = \"" + preset.name + "\"");
    ASSERT_TRUE(named.has_value());
    EXPECT_EQ(*named, preset.config);
    EXPECT_EQ(DescribeSensor(preset.config) == "exact", preset.name == "exact");
  }
}

// Every depth model has a preset of its name that is it alone.
TEST(SensorConfig, EveryDepthModelHasAPreset) {
  for (std::size_t i = 0; i < DepthModelNames().size(); ++i) {
    SensorConfig expected;
    expected.depth.model = static_cast<DepthModel>(i);
    const auto config = SensorPresetNamed(DepthModelNames()[i]);
    ASSERT_TRUE(config.has_value());
    EXPECT_EQ(*config, expected);
    EXPECT_EQ(DepthModelName(expected.depth.model), DepthModelNames()[i]);
  }
}

// A value for every key, none of them a default or a short decimal.
TEST(SensorConfig, EveryKeyReadsBack) {
  SensorConfig config;
  config.depth = {0.1 / 3,  1.0 / 7,  0.2 / 3,   DepthModel::kRedwood,
                  1.0 / 3,  10.0 / 3, 200.0 / 3, 4.0 / 3,
                  20.0 / 3, 1.0 / 6,  11.0 / 3,  1e-3 / 3};
  config.colour = {-1.0 / 3, 0.1 / 3, 2.0 / 3, 1e5 / 3, 5.0 / 3};
  config.shutter = {0.01 / 3, 0.02 / 3, 7};
  config.camera_pose = {1e-4 / 3, 0.1 / 3, 1e-3 / 3, 1.0 / 3};
  config.masks = {{0.1 / 3, 2},      {{0.2 / 3, 3}, 4}, {{0.4 / 3, 5}, 6}, {0.5 / 3, 7},
                  {{0.7 / 3, 8}, 9}, {0.8 / 3, 10},     {1.0 / 3, 11}};
  const std::string text = SensorConfigToToml(config);
  const auto again = Read(text);
  ASSERT_TRUE(again.has_value()) << again.error().message;
  EXPECT_EQ(*again, config);
  EXPECT_EQ(SensorConfigToToml(*again), text);
  // The description names each of the 41 keys, since each has changed.
  const std::string description = DescribeSensor(config);
  EXPECT_EQ(std::count(text.begin(), text.end(), '='), 41);
  EXPECT_EQ(std::count(description.begin(), description.end(), '='), 41);
}

TEST(SensorConfig, KeysReplaceThePresets) {
  const auto config = Read(
      "[sensor]\npreset = \"kinect\"\ndepth = {noise_scale = 0.5}\n"
      "[sensor.masks.bleed]\nrate = 0.25\npixels = 4\n");
  ASSERT_TRUE(config.has_value());
  SensorConfig expected = *SensorPresetNamed("kinect");
  expected.depth.noise_scale = 0.5;
  expected.masks.bleed = {{0.25, 1}, 4};
  EXPECT_EQ(*config, expected);
}

TEST(SensorConfig, Describes) {
  SensorConfig config;
  config.depth.model = DepthModel::kD435;
  config.masks.bleed.timing.rate = 0.2;
  EXPECT_EQ(DescribeSensor(config), "depth.model = \"d435\", masks.bleed.rate = 0.2");
}

TEST(SensorConfig, NamesWhatIsWrong) {
  EXPECT_EQ(FaultOf("[sensor]\ndeepth = {}"), "s.toml:2: 'sensor.deepth' is not a known key here");
  EXPECT_EQ(FaultOf("[sensor.depth]\nunit = 1"),
            "s.toml:2: 'sensor.depth.unit' is not a known key here");
  EXPECT_EQ(FaultOf("[sensor.masks.bleed]\nrate = 0.1\npixel = 2"),
            "s.toml:3: 'sensor.masks.bleed.pixel' is not a known key here");
  EXPECT_EQ(FaultOf("[sensor.masks.missing]\npixels = 2"),
            "s.toml:2: 'sensor.masks.missing.pixels' is not a known key here");
  EXPECT_EQ(FaultOf("[sensor.masks]\nsplit = 0.2"),
            "s.toml:2: 'sensor.masks.split' is a floating-point number, expected a table");
  EXPECT_EQ(FaultOf("[sensor.depth]\nunit_m = \"1 mm\""),
            "s.toml:2: 'sensor.depth.unit_m' is a string, expected a finite number");
  EXPECT_EQ(FaultOf("[sensor.depth]\nunit_m = nan"),
            "s.toml:2: 'sensor.depth.unit_m' is not a finite number");
  EXPECT_EQ(FaultOf("[sensor.masks.missing]\nrate = 0.1\nframes = 2.5"),
            "s.toml:3: 'sensor.masks.missing.frames' is a floating-point number, expected a whole "
            "number");
  EXPECT_EQ(FaultOf("[sensor.depth]\nflying_pixel_rate = 1.5"),
            "s.toml:2: 'sensor.depth.flying_pixel_rate' is 1.5, expected 0 to 1");
  EXPECT_EQ(FaultOf("[sensor.masks.bleed]\npixels = 0"),
            "s.toml:2: 'sensor.masks.bleed.pixels' is 0, expected 1 to 32");
  EXPECT_EQ(FaultOf("[sensor.depth]\nmodel = \"kinect3\""),
            "s.toml:2: 'sensor.depth.model' is 'kinect3', expected one of: exact, nguyen2012, "
            "icl_nuim, simkinect, cofusion, redwood, azure, d435");
  EXPECT_EQ(FaultOf("[sensor.depth]\nmodel = 3"),
            "s.toml:2: 'sensor.depth.model' is an integer, expected a string");
  EXPECT_EQ(FaultOf("[sensor.depth]\nmin_range_m = 3\nmax_range_m = 2"),
            "s.toml:3: 'sensor.depth.max_range_m' is 2, expected min_range_m (3) at least");
  EXPECT_EQ(FaultOf("[sensor.depth]\ndropout_incidence_end_deg = 60"),
            "s.toml:2: 'sensor.depth.dropout_incidence_end_deg' is 60, expected "
            "dropout_incidence_start_deg (90) at least");
  EXPECT_EQ(
      FaultOf("[sensor.depth]\ndropout_range_end_m = 6"),
      "s.toml:2: 'sensor.depth.dropout_range_end_m' is 6, expected dropout_range_start_m (100) "
      "at least");
  EXPECT_EQ(FaultOf("[sensor.shutter]\nexposure_s = 0.01"),
            "s.toml:1: 'sensor.shutter.sub_frames' is 1, expected 2 at least where exposure_s or "
            "readout_s is above 0");
  EXPECT_EQ(FaultOf("[sensor.shutter]\nsub_frames = 4"),
            "s.toml:2: 'sensor.shutter.sub_frames' is 4, expected 1 where exposure_s and readout_s "
            "are 0");
  EXPECT_EQ(
      FaultOf("[sensor]\npreset = \"kinect+d435\""),
      "s.toml:2: 'sensor.preset' is 'kinect+d435': sensor preset 'kinect+d435' joins two that "
      "both set the same part of the sensor");
}

TEST(SensorConfig, ValidatesWithoutAFile) {
  SensorConfig config;
  config.camera_pose.drift_m = -1;
  const auto result = ValidateSensorConfig(config);
  ASSERT_FALSE(result.has_value());
  EXPECT_EQ(result.error().kind, ErrorKind::kUsage);
  EXPECT_EQ(result.error().message, "'sensor.camera_pose.drift_m' is -1, expected 0 to 1");
  config = {};
  config.masks.merged.timing.rate = std::nan("");
  EXPECT_EQ(ValidateSensorConfig(config).error().message,
            "'sensor.masks.merged.rate' is nan, expected 0 to 1");
  config = {};
  config.depth.min_range_m = 3;
  config.depth.max_range_m = 1;
  EXPECT_EQ(ValidateSensorConfig(config).error().message,
            "'sensor.depth.max_range_m' is 1, expected min_range_m (3) at least");
}

TEST(SensorConfig, PresetsJoin) {
  SensorConfig expected = *SensorPresetNamed("kinect");
  expected.masks = SensorPresetNamed("masks_mild")->masks;
  expected.camera_pose = SensorPresetNamed("pose_drift")->camera_pose;
  for (const std::string name :
       {"kinect+masks_mild+pose_drift", "pose_drift+exact+kinect+masks_mild"}) {
    const auto joined = SensorPresetNamed(name);
    ASSERT_TRUE(joined.has_value()) << joined.error().message;
    EXPECT_EQ(*joined, expected);
  }
}

TEST(SensorConfig, UnknownPreset) {
  for (const auto& [name, unknown] : {std::pair{"xbox", "xbox"}, std::pair{"kinect+xbox", "xbox"},
                                      std::pair{"kinect,d435", "kinect,d435"}}) {
    const auto config = SensorPresetNamed(name);
    ASSERT_FALSE(config.has_value()) << name;
    EXPECT_EQ(config.error().kind, ErrorKind::kUsage);
    const std::string start = fmt::format(
        "sensor preset '{}' does not exist, expected one of, or several joined by '+': exact, ",
        unknown);
    EXPECT_EQ(config.error().message.substr(0, start.size()), start);
  }
  for (const std::string name : {"", "+", "kinect+", "+kinect", "kinect++pose_drift"}) {
    const auto config = SensorPresetNamed(name);
    ASSERT_FALSE(config.has_value()) << name;
    EXPECT_EQ(config.error().message,
              "sensor preset '" + name +
                  "' leaves a name out, expected one name or several joined by '+', e.g. "
                  "kinect+masks_mild");
  }
}

}  // namespace
}  // namespace tsdfpp
