// Reads and writes the keys of [camera] that say where it is.
#include <array>
#include <cmath>

#include "sim/config/camera_path.h"
#include "sim/config/scene_readers.h"
#include "sim/config/toml_writer.h"

namespace tsdfpp {
namespace {

constexpr std::array<const char*, 4> kPathNames{"arc", "orbit", "spline", "recorded"};

void CheckPositive(TomlReader& reader, std::string_view key, double value) {
  if (!(value > 0)) reader.Fault(key, fmt::format("is {}, expected a positive number", value));
}

void ReadArc(TomlReader& reader, ArcPath& path) {
  reader.Get("target", path.target_W, true);
  reader.Get("azimuth_deg", path.azimuth_deg, true);
  reader.Get("radius_m", path.radius_m, true);
  reader.Get("height_m", path.height_m, true);
  if (path.azimuth_deg.size() < 2) reader.Fault("azimuth_deg", "needs two keys at least");
  for (const auto& [key, values] :
       {std::pair{"radius_m", &path.radius_m}, std::pair{"height_m", &path.height_m}}) {
    if (values->size() != path.azimuth_deg.size()) {
      reader.Fault(key, fmt::format("has {} keys, azimuth_deg has {}", values->size(),
                                    path.azimuth_deg.size()));
    }
    for (const double value : *values) {
      if (!(value > 0)) reader.Fault(key, fmt::format("has {}, expected positive numbers", value));
    }
  }
}

void ReadOrbit(TomlReader& reader, OrbitPath& path) {
  reader.Get("target", path.target_W, true).Get("start_azimuth_deg", path.start_azimuth_deg);
  reader.Get("turns", path.turns).Get("radius_m", path.radius_m, true);
  reader.Get("height_m", path.height_m, true);
  CheckPositive(reader, "radius_m", path.radius_m);
  CheckPositive(reader, "height_m", path.height_m);
}

// Looking straight up or down, no row of the image would be level.
bool IsAbove(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  constexpr double kLeast_m = 1e-3;
  return (a - b).head<2>().norm() < kLeast_m;
}

Expected<void> ReadSpline(TomlReader& reader, SplinePath& path) {
  const auto tables = reader.Tables("key", true);
  for (std::size_t i = 0; i < tables.size(); ++i) {
    TomlReader key_reader(*tables[i], reader.where(), reader.PathOf(fmt::format("key[{}]", i)));
    CameraKey key;
    key_reader.Get("frame", key.frame, true).Get("position", key.position_W, true);
    key_reader.Get("target", key.target_W, true);
    if (i > 0 && key.frame <= path.keys.back().frame) {
      key_reader.Fault("frame", fmt::format("is {}, expected more than the key before it ({})",
                                            key.frame, path.keys.back().frame));
    }
    if (IsAbove(key.position_W, key.target_W)) {
      key_reader.Fault("target", "is straight above or below the position");
    }
    TSDFPP_RETURN_IF_ERROR(key_reader.Finish());
    path.keys.push_back(key);
  }
  if (path.keys.size() < 2) reader.Fault("key", "needs two at least");
  return {};
}

void ReadRecorded(TomlReader& reader, const SceneFolder& folder, RecordedPath& path) {
  reader.Get("file", path.file, true).Get("start_s", path.start_s);
  reader.Get("position", path.position_W, true).Get("target", path.target_W, true);
  if (path.file.empty()) reader.Fault("file", "is empty");
  if (!(path.start_s >= 0))
    reader.Fault("start_s", fmt::format("is {}, expected >= 0", path.start_s));
  if (IsAbove(path.position_W, path.target_W)) {
    reader.Fault("target", "is straight above or below the position");
  }
  if (path.file.empty()) return;
  if (const auto file = folder.Find(reader, "file", path.file)) path.file = file->string();
}

Expected<HandJitter> ReadJitter(const toml::table& table, const TomlReader& camera) {
  TomlReader reader(table, camera.where(), camera.PathOf("jitter"));
  HandJitter jitter;
  reader.Get("position_mm", jitter.position_mm).Get("rotation_deg", jitter.rotation_deg);
  reader.Get("lowest_hz", jitter.lowest_hz).Get("highest_hz", jitter.highest_hz);
  constexpr double kMostPosition_mm = 100;
  constexpr double kMostRotation_deg = 20;
  const auto check = [&](const char* key, double value, double most) {
    if (!(value >= 0 && value <= most)) {
      reader.Fault(key, fmt::format("is {}, expected 0 to {}", value, most));
    }
  };
  check("position_mm", jitter.position_mm, kMostPosition_mm);
  check("rotation_deg", jitter.rotation_deg, kMostRotation_deg);
  constexpr double kLeast_hz = 1e-3;
  constexpr double kMost_hz = 1000;
  CheckRange(reader, "lowest_hz", jitter.lowest_hz, kLeast_hz, kMost_hz);
  CheckRange(reader, "highest_hz", jitter.highest_hz, kLeast_hz, kMost_hz);
  if (!(jitter.highest_hz > jitter.lowest_hz)) {
    reader.Fault("highest_hz", fmt::format("is {}, expected more than lowest_hz ({})",
                                           jitter.highest_hz, jitter.lowest_hz));
  }
  TSDFPP_RETURN_IF_ERROR(reader.Finish());
  return jitter;
}

}  // namespace

Expected<void> ReadCameraPath(TomlReader& reader, const SceneFolder& folder, CameraConfig& camera) {
  std::string name = kPathNames[0];
  reader.Get("path", name);
  if (name == kPathNames[0]) {
    ReadArc(reader, camera.path.emplace<ArcPath>());
  } else if (name == kPathNames[1]) {
    ReadOrbit(reader, camera.path.emplace<OrbitPath>());
  } else if (name == kPathNames[2]) {
    TSDFPP_RETURN_IF_ERROR(ReadSpline(reader, camera.path.emplace<SplinePath>()));
  } else if (name == kPathNames[3]) {
    ReadRecorded(reader, folder, camera.path.emplace<RecordedPath>());
  } else {
    reader.Fault("path",
                 fmt::format("is '{}', expected one of: {}", name, fmt::join(kPathNames, ", ")));
  }
  if (const toml::table* jitter = reader.Table("jitter")) {
    TSDFPP_ASSIGN(camera.jitter, ReadJitter(*jitter, reader));
  }
  return {};
}

void WriteCameraPath(const CameraConfig& camera, toml::table& table) {
  table.insert("path", kPathNames[camera.path.index()]);
  if (const auto* arc = std::get_if<ArcPath>(&camera.path)) {
    table.insert("target", TomlArray(arc->target_W));
    table.insert("azimuth_deg", TomlArray(arc->azimuth_deg));
    table.insert("radius_m", TomlArray(arc->radius_m));
    table.insert("height_m", TomlArray(arc->height_m));
  } else if (const auto* orbit = std::get_if<OrbitPath>(&camera.path)) {
    table.insert("target", TomlArray(orbit->target_W));
    table.insert("start_azimuth_deg", orbit->start_azimuth_deg);
    table.insert("turns", orbit->turns);
    table.insert("radius_m", orbit->radius_m);
    table.insert("height_m", orbit->height_m);
  } else if (const auto* spline = std::get_if<SplinePath>(&camera.path)) {
    toml::array keys;
    for (const CameraKey& key : spline->keys) {
      keys.push_back(toml::table{{"frame", key.frame},
                                 {"position", TomlArray(key.position_W)},
                                 {"target", TomlArray(key.target_W)}});
    }
    table.insert("key", std::move(keys));
  } else if (const auto* recorded = std::get_if<RecordedPath>(&camera.path)) {
    table.insert("file", recorded->file);
    table.insert("start_s", recorded->start_s);
    table.insert("position", TomlArray(recorded->position_W));
    table.insert("target", TomlArray(recorded->target_W));
  }
  if (camera.jitter) {
    table.insert("jitter", toml::table{{"position_mm", camera.jitter->position_mm},
                                       {"rotation_deg", camera.jitter->rotation_deg},
                                       {"lowest_hz", camera.jitter->lowest_hz},
                                       {"highest_hz", camera.jitter->highest_hz}});
  }
}

}  // namespace tsdfpp
