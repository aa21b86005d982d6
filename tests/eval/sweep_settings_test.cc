// The settings of a cell: their axes, their JSON, and what of them a map depends on.
#include "eval/sweep/sweep_settings.h"

#include <gtest/gtest.h>

namespace tsdfpp {
namespace {

TEST(SweepSettings, SettingsComeBackFromJson) {
  CellSettings settings;
  settings.scene = "a.toml";
  settings.seed = 77;
  settings.sensor = "kinect";
  settings.noise = 0;
  settings.layers = 3;
  settings.trunc_back = 5;
  settings.resampling = "observed";
  settings.segmentation = "full";
  const auto back = SettingsFromJson(SettingsJson(settings));
  ASSERT_TRUE(back.has_value()) << back.error().message;
  EXPECT_EQ(SettingsJson(*back), SettingsJson(settings));
  nlohmann::json broken = SettingsJson(settings);
  broken["voxel_m"] = 7;
  EXPECT_FALSE(SettingsFromJson(broken).has_value());
  broken.erase("voxel_m");
  EXPECT_FALSE(SettingsFromJson(broken).has_value());
}

// What makes no difference to a method makes no cell; what does, does.
TEST(SweepSettings, TheKeyOfAMapIsWhatItDependsOn) {
  const auto key = [](const std::string& method, const auto& change) {
    CellSettings settings;
    settings.method = method;
    change(settings);
    return MapKey(settings);
  };
  const auto nothing = [](CellSettings&) {};
  const auto layers = [](int k) { return [k](CellSettings& s) { s.layers = k; }; };
  EXPECT_EQ(key("tsdf", nothing), key("tsdf", layers(4)));
  EXPECT_EQ(key("tsdf++", nothing), key("tsdf++", layers(2)));
  EXPECT_NE(key("tsdf++", nothing), key("tsdf++", layers(4)));
  EXPECT_EQ(key("tsdf++/anchored", nothing), key("tsdf++/anchored", layers(4)));
  const auto back = [](CellSettings& s) { s.trunc_back = 10; };
  const auto paper = [](CellSettings& s) { s.profile = "paper"; };
  EXPECT_EQ(key("tsdf", back), key("tsdf", paper));
  EXPECT_NE(key("tsdf", back), key("tsdf", nothing));
  // Open3D's band is its own, and all that tells two of its maps apart but the voxel.
  EXPECT_NE(key("open3d/3", nothing), key("open3d/10", nothing));
  EXPECT_EQ(key("open3d/3", paper), key("open3d/3", nothing));
  EXPECT_EQ(key("open3d/10", back), key("open3d/10", nothing));
  EXPECT_EQ(key("open3d/10", layers(4)), key("open3d/10", nothing));
  const auto observed = [](CellSettings& s) { s.resampling = "observed"; };
  EXPECT_EQ(key("tsdf++/anchored", observed), key("tsdf++/anchored", nothing));
  EXPECT_NE(key("tsdf++", observed), key("tsdf++", nothing));
  const auto icp = [](CellSettings& s) { s.poses = "icp"; };
  EXPECT_NE(key("tsdf", icp), key("tsdf", nothing));
  const auto track = [](CellSettings& s) { s.poses = "track"; };
  const auto depth = [](CellSettings& s) { s.poses = "track", s.segmentation = "depth"; };
  const auto full = [](CellSettings& s) { s.poses = "track", s.segmentation = "full"; };
  EXPECT_NE(key("tsdf++", depth), key("tsdf++", track));
  EXPECT_NE(key("tsdf++", full), key("tsdf++", depth));
  const auto voxel = [](CellSettings& s) { s.voxel_m = 0.02; };
  for (const char* method : {"tsdf", "tsdf++", "tsdf++/anchored", "volumes", "open3d/10"}) {
    EXPECT_NE(key(method, voxel), key(method, nothing)) << method;
  }
}

// A network of the user's own cannot be named, and no objects at all are no experiment.
TEST(SweepSettings, SegmentationsAreThoseThatNeedNoFile) {
  const Axis& axis = *FindAxis("segmentation");
  CellSettings settings;
  for (const char* known : {"gt", "depth", "full"}) {
    EXPECT_TRUE(axis.set(settings, AxisValue(known)).has_value()) << known;
  }
  for (const char* refused : {"network", "none", "given"}) {
    const auto set = axis.set(settings, AxisValue(refused));
    ASSERT_FALSE(set.has_value()) << refused;
    EXPECT_NE(set.error().message.find(refused), std::string::npos) << set.error().message;
  }
}

}  // namespace
}  // namespace tsdfpp
