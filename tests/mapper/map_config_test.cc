#include "mapper/map_config.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <vector>

namespace tsdfpp {
namespace {

using ::testing::AssertionFailure;
using ::testing::AssertionResult;
using ::testing::AssertionSuccess;

AssertionResult Says(const std::string& message, const std::vector<std::string>& words) {
  for (const std::string& word : words) {
    if (message.find(word) == std::string::npos) {
      return AssertionFailure() << "'" << message << "' does not say '" << word << "'";
    }
  }
  return AssertionSuccess();
}

TEST(MapConfigTest, DefaultsAreValidAndAreTheCloseProfile) {
  const MapConfig config;
  EXPECT_TRUE(config.Validate().has_value());
  MapConfig close;
  close.trunc_front_voxels = 7;
  close.trunc_back_voxels = 7;
  ASSERT_TRUE(close.SetProfile("close").has_value());
  EXPECT_EQ(close, config);
  EXPECT_EQ(config.voxel(), 0.01F);
  // In half precision: eleven bits.
  EXPECT_EQ(config.front(), 1638.0F / 16384);
  EXPECT_EQ(config.back(), 1966.0F / 65536);
}

TEST(MapConfigTest, ProfilePaperIsTenAndTen) {
  MapConfig config;
  ASSERT_TRUE(config.SetProfile("paper").has_value());
  EXPECT_EQ(config.trunc_front_voxels, 10);
  EXPECT_EQ(config.trunc_back_voxels, 10);
}

TEST(MapConfigTest, UnknownProfileIsNamed) {
  MapConfig config;
  const auto result = config.SetProfile("wide");
  ASSERT_FALSE(result.has_value());
  EXPECT_EQ(result.error().kind, ErrorKind::kUsage);
  EXPECT_TRUE(Says(result.error().message, {"wide", "paper", "close"}));
  EXPECT_EQ(config, MapConfig{});
}

TEST(MapConfigTest, EachBadFieldIsNamedWithItsValue) {
  struct Case {
    std::string field;
    std::string found;
    std::function<void(MapConfig&)> spoil;
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  const std::vector<Case> cases = {
      {"voxel_m", "0", [](MapConfig& c) { c.voxel_m = 0; }},
      {"voxel_m", "-0.01", [](MapConfig& c) { c.voxel_m = -0.01; }},
      {"voxel_m", "nan", [nan](MapConfig& c) { c.voxel_m = nan; }},
      {"voxel_m", "inf", [infinity](MapConfig& c) { c.voxel_m = infinity; }},
      {"trunc_front_voxels", "0", [](MapConfig& c) { c.trunc_front_voxels = 0; }},
      {"trunc_front_voxels", "nan", [nan](MapConfig& c) { c.trunc_front_voxels = nan; }},
      {"trunc_back_voxels", "-3", [](MapConfig& c) { c.trunc_back_voxels = -3; }},
      {"trunc_back_voxels", "nan", [nan](MapConfig& c) { c.trunc_back_voxels = nan; }},
      {"layers", "-1", [](MapConfig& c) { c.layers = -1; }},
      {"layers", "9", [](MapConfig& c) { c.layers = 9; }},
      {"weight_cap", "0", [](MapConfig& c) { c.weight_cap = 0; }},
      {"weight_cap", "256", [](MapConfig& c) { c.weight_cap = 256; }},
      {"confidence_cap", "0", [](MapConfig& c) { c.confidence_cap = 0; }},
      {"confidence_cap", "256", [](MapConfig& c) { c.confidence_cap = 256; }},
      {"moved_confidence", "-2", [](MapConfig& c) { c.moved_confidence = -2; }},
      {"moved_confidence", "11", [](MapConfig& c) { c.moved_confidence = c.confidence_cap + 1; }},
  };
  for (const Case& bad : cases) {
    MapConfig config;
    bad.spoil(config);
    const auto result = config.Validate();
    ASSERT_FALSE(result.has_value()) << bad.field << " = " << bad.found;
    EXPECT_EQ(result.error().kind, ErrorKind::kUsage);
    EXPECT_TRUE(Says(result.error().message, {bad.field, bad.found}));
  }
}

TEST(MapConfigTest, TomlRoundTrip) {
  MapConfig config;
  config.voxel_m = 0.0125;
  config.trunc_front_voxels = 6.5;
  config.trunc_back_voxels = 2.5;
  config.layers = 3;
  config.weight_cap = 77;
  config.confidence_cap = 5;
  config.moved_confidence = 4;
  config.contradiction = false;
  config.rims = false;
  config.relist_on_removal = true;
  config.colour_whole_band = true;
  config.distances = Distances::kSurface;
  config.resampling = Resampling::kObserved;
  config.moved_voxels = MovedVoxels::kNearSurface;
  config.removed_voxels = RemovedVoxels::kUnobserved;
  config.vote_band_voxels = 2.5;
  ASSERT_TRUE(config.Validate().has_value());
  const auto again = MapConfig::FromToml(config.ToToml(), "memory");
  ASSERT_TRUE(again.has_value()) << again.error().message;
  EXPECT_EQ(*again, config);
}

TEST(MapConfigTest, LayersGoUpToEight) {
  for (int layers = 0; layers <= 8; ++layers) {
    MapConfig config;
    config.layers = layers;
    EXPECT_TRUE(config.Validate().has_value()) << layers;
  }
}

TEST(MapConfigTest, AbsentKeysKeepTheirDefaults) {
  const auto config = MapConfig::FromToml(toml::table{{"voxel_m", 0.02}}, "map.toml");
  ASSERT_TRUE(config.has_value()) << config.error().message;
  MapConfig expected;
  expected.voxel_m = 0.02;
  EXPECT_EQ(*config, expected);
}

TEST(MapConfigTest, TomlFaultsNameFileAndKey) {
  struct Case {
    std::string key;
    toml::table table;
  };
  const std::vector<Case> cases = {
      {"voxle_m", toml::table{{"voxle_m", 0.02}}},       // unknown
      {"voxel_m", toml::table{{"voxel_m", "2 cm"}}},     // wrong type
      {"weight_cap", toml::table{{"weight_cap", 1.5}}},  // not a whole number
      {"voxel_m", toml::table{{"voxel_m", -1.0}}},       // invalid
      {"confidence_cap", toml::table{{"confidence_cap", 0}}},
      {"layers", toml::table{{"layers", 9}}},
      {"distances", toml::table{{"distances", "some"}}},
      {"resampling", toml::table{{"resampling", "some"}}},
      {"resampling", toml::table{{"resampling", true}}},
      {"moved_voxels", toml::table{{"moved_voxels", "some"}}},
      {"moved_voxels", toml::table{{"moved_voxels", 1}}},
      {"removed_voxels", toml::table{{"removed_voxels", "gone"}}},
      {"vote_band_voxels", toml::table{{"vote_band_voxels", 0.5}}},
  };
  for (const Case& bad : cases) {
    const auto config = MapConfig::FromToml(bad.table, "my-map.toml");
    ASSERT_FALSE(config.has_value()) << bad.key;
    EXPECT_EQ(config.error().kind, ErrorKind::kUsage);
    EXPECT_TRUE(Says(config.error().message, {"my-map.toml", bad.key}));
  }
}

TEST(MethodTest, NamesAreThereAndBack) {
  const std::vector<std::string> names = {
      "tsdf",           "tsdf/min",        "tsdf/guarded", "tsdf/static", "tsdf++",
      "tsdf++/literal", "tsdf++/anchored", "volumes",      "surfels"};
  EXPECT_LE(names.size(), AllMethods().size());
  for (const std::string& name : names) {
    const auto method = MethodFromName(name);
    ASSERT_TRUE(method.has_value()) << name;
    EXPECT_EQ(MethodName(*method), name);
  }
  EXPECT_EQ(MethodFromName("anchored").value(), Method::kTsdfppAnchored);
  EXPECT_EQ(MethodFromName("literal").value(), Method::kTsdfppLiteral);
}

TEST(MethodTest, UnknownNameListsTheMethods) {
  for (const std::string name : {"", "TSDF", "tsdf+", "tsdf++/"}) {
    const auto method = MethodFromName(name);
    ASSERT_FALSE(method.has_value()) << name;
    EXPECT_EQ(method.error().kind, ErrorKind::kUsage);
    EXPECT_TRUE(Says(method.error().message, {name, "tsdf/min", "tsdf/static", "tsdf++/anchored"}));
  }
}

TEST(MethodTest, LayersDependOnTheMethod) {
  MapConfig config;
  EXPECT_EQ(LayersOf(Method::kTsdf, config), 1);
  EXPECT_EQ(LayersOf(Method::kTsdfMin, config), 1);
  EXPECT_EQ(LayersOf(Method::kTsdfGuarded, config), 1);
  EXPECT_EQ(LayersOf(Method::kTsdfStatic, config), 1);
  EXPECT_EQ(LayersOf(Method::kTsdfpp, config), 2);
  EXPECT_EQ(LayersOf(Method::kTsdfppLiteral, config), 2);
  EXPECT_EQ(LayersOf(Method::kTsdfppAnchored, config), 4);
  EXPECT_EQ(LayersOf(Method::kVolumes, config), 8);
  config.layers = 3;
  EXPECT_EQ(LayersOf(Method::kTsdfpp, config), 3);
  EXPECT_EQ(LayersOf(Method::kTsdfppAnchored, config), 3);
  EXPECT_EQ(LayersOf(Method::kVolumes, config), 8);
}

}  // namespace
}  // namespace tsdfpp
