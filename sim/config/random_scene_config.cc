#include "sim/config/random_scene_config.h"

#include <algorithm>
#include <cmath>

#include "sim/config/scene_readers.h"

namespace tsdfpp {
namespace {

const std::vector<std::pair<std::string, RandomMotion>>& MotionNames() {
  static const std::vector<std::pair<std::string, RandomMotion>> names{
      {"rest", RandomMotion::kRest},
      {"drive", RandomMotion::kDrive},
      {"carry", RandomMotion::kCarry},
      {"drop", RandomMotion::kDrop}};
  return names;
}

void ReadMotions(TomlReader& reader, std::vector<RandomMotion>& motions) {
  std::vector<std::string> names;
  reader.Get("motions", names, true);
  for (const std::string& name : names) {
    const auto found = std::find_if(MotionNames().begin(), MotionNames().end(),
                                    [&](const auto& known) { return known.first == name; });
    if (found == MotionNames().end()) {
      reader.Fault("motions", fmt::format("has '{}', expected rest, drive, carry or drop", name));
      return;
    }
    motions.push_back(found->second);
  }
  if (motions.empty()) reader.Fault("motions", "is empty");
}

void ReadModels(TomlReader& reader, std::vector<std::string>& models) {
  reader.Get("models", models, true);
  if (models.empty()) reader.Fault("models", "is empty");
  for (const std::string& name : models) {
    if (FindModel(name) == nullptr) {
      reader.Fault("models", fmt::format("has '{}', which is no model", name));
    }
  }
}

Expected<void> ReadCameraRanges(const toml::table& table, const std::string& where,
                                RandomSceneConfig& config) {
  TomlReader reader(table, where, "random.camera");
  reader.Get("paths", config.camera_paths);
  for (const std::string& path : config.camera_paths) {
    if (path != "arc" && path != "orbit" && path != "spline") {
      reader.Fault("paths", fmt::format("has '{}', expected arc, orbit or spline", path));
    }
  }
  if (config.camera_paths.empty()) reader.Fault("paths", "is empty");
  GetRange(reader, "radius_m", config.camera_radius_m, 0.1, 1.9);
  GetRange(reader, "height_m", config.camera_height_m, 0.05, 1.6);
  GetRange(reader, "azimuth_deg", config.camera_azimuth_deg, -360, 360);
  GetRange(reader, "sweep_deg", config.camera_sweep_deg, 0, 360);
  reader.Get("handheld_share", config.handheld_share);
  CheckRange(reader, "handheld_share", config.handheld_share, 0.0, 1.0);
  GetRange(reader, "jitter_mm", config.jitter_mm, 0, 100);
  GetRange(reader, "jitter_deg", config.jitter_deg, 0, 20);
  return reader.Finish();
}

Expected<void> ReadLights(const toml::table& table, const std::string& where, LightRanges& lights) {
  TomlReader reader(table, where, "random.lights");
  Eigen::Vector2d count(lights.least_lights, lights.most_lights);
  GetRange(reader, "count", count, 1, static_cast<double>(kMaxLights));
  lights.least_lights = static_cast<int>(count[0]);
  lights.most_lights = static_cast<int>(count[1]);
  GetRange(reader, "ambient", lights.ambient, 0, 1);
  GetRange(reader, "strength", lights.strength, 0, 1);
  reader.Get("tint", lights.tint).Get("shadow_share", lights.shadow_share);
  GetRange(reader, "distance_m", lights.distance_m, 0, 2);
  GetRange(reader, "height_m", lights.height_m, 0.1, 1.8);
  TSDFPP_RETURN_IF_ERROR(reader.Finish());
  if (const auto valid = lights.Validate(); !valid) {
    return UsageError("{}: random.lights.{}", where, valid.error().message);
  }
  return {};
}

}  // namespace

bool IsRandomScene(const toml::table& root) { return root.contains("random"); }

Expected<RandomSceneConfig> ReadRandomScene(const toml::table& root, const std::string& where) {
  TomlReader reader(root, where);
  RandomSceneConfig config;
  reader.Get("name", config.name, true).Get("purpose", config.purpose, true);
  reader.Get("frames", config.frames, true).Get("rate_hz", config.rate_hz, true);
  GetSeed(reader, "seed", config.seed);
  CheckPlainName(reader, config.name);
  // A thing that is carried has four keys.
  CheckRange(reader, "frames", config.frames, 4, 100000);
  CheckRange(reader, "rate_hz", config.rate_hz, 0.1, 1000.0);
  const toml::table* camera = reader.Table("camera", true);
  const toml::table* random = reader.Table("random", true);
  const toml::table* sensor = reader.Table("sensor");
  TSDFPP_RETURN_IF_ERROR(reader.Finish());

  TomlReader camera_reader(*camera, where, "camera");
  ReadIntrinsics(camera_reader, *camera, config.intrinsics);
  TSDFPP_RETURN_IF_ERROR(camera_reader.Finish());
  if (sensor != nullptr) {
    TSDFPP_ASSIGN(config.sensor, ReadSensorConfig(*sensor, where));
    TSDFPP_RETURN_IF_ERROR(CheckSamples(config.sensor, config.intrinsics, where));
  }

  TomlReader ranges(*random, where, "random");
  GetRange(ranges, "objects", config.objects, 1, kMaxObjectId);
  for (const double count : config.objects) {
    if (count != std::floor(count)) ranges.Fault("objects", "has no whole numbers");
  }
  ReadModels(ranges, config.models);
  GetRange(ranges, "scale", config.scale, 0.05, 3);
  GetRange(ranges, "size_m", config.size_m, 0.01, 0.5);
  ranges.Get("texture_share", config.texture_share);
  CheckRange(ranges, "texture_share", config.texture_share, 0.0, 1.0);
  ranges.Get("room_texture_share", config.room_texture_share);
  CheckRange(ranges, "room_texture_share", config.room_texture_share, 0.0, 1.0);
  ReadMotions(ranges, config.motions);
  GetRange(ranges, "speed", config.speed, 0.01, 2);
  ranges.Get("gap_m", config.gap_m).Get("in_view", config.in_view);
  CheckRange(ranges, "gap_m", config.gap_m, 0.0, 0.5);
  CheckRange(ranges, "in_view", config.in_view, 0.0, 1.0);
  const toml::table* paths = ranges.Table("camera", true);
  const toml::table* lights = ranges.Table("lights");
  TSDFPP_RETURN_IF_ERROR(ranges.Finish());
  TSDFPP_RETURN_IF_ERROR(ReadCameraRanges(*paths, where, config));
  if (lights != nullptr) {
    TSDFPP_RETURN_IF_ERROR(ReadLights(*lights, where, config.lights));
  }
  return config;
}

}  // namespace tsdfpp
