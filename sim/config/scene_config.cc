#include "sim/config/scene_config.h"

#include <algorithm>
#include <cmath>

#include "core/folders.h"
#include "core/toml_reader.h"
#include "sim/config/scene_object_config.h"
#include "sim/config/scene_readers.h"

namespace tsdfpp {
namespace {

constexpr int kMaxFrames = 100000;
// How far the camera keeps from walls and ceiling: beyond the near clipping plane.
constexpr double kWallDistance_m = 0.15;

Expected<void> CheckInRoom(TomlReader& reader, const SceneConfig& config) {
  TSDFPP_ASSIGN(const CameraMotion motion,
                CameraMotion::Make(config.camera, config.frames, config.rate_hz, config.seed));
  const RoomSpec& room = config.room;
  const char* const key = std::holds_alternative<ArcPath>(config.camera.path) ? "radius_m" : "path";
  for (int frame = kFirstFrame; frame < kFirstFrame + config.frames; ++frame) {
    const Eigen::Vector3d at = motion.T_WC(frame).translation();
    const double kept = kWallDistance_m;
    // Whatever is no number is not in it, either.
    if (!(std::abs(at.x()) <= room.half_x - kept && std::abs(at.y()) <= room.half_y - kept &&
          at.z() <= room.height - kept && at.z() >= kept)) {
      reader.Fault(key, fmt::format("and the other keys put the camera at ({:.2f}, {:.2f}, "
                                    "{:.2f}) m in frame {}, which is outside the room",
                                    at.x(), at.y(), at.z(), frame));
      break;
    }
  }
  return reader.Finish();
}

Expected<void> ReadCamera(const toml::table& table, const std::string& where,
                          const SceneFolder& folder, SceneConfig& config) {
  TomlReader reader(table, where, "camera");
  ReadIntrinsics(reader, table, config.intrinsics);
  TSDFPP_RETURN_IF_ERROR(ReadCameraPath(reader, folder, config.camera));
  TSDFPP_RETURN_IF_ERROR(reader.Finish());
  return CheckInRoom(reader, config);
}

Expected<TextureSpec> ReadTexture(const toml::table& table, const std::string& where,
                                  const std::string& path) {
  TomlReader reader(table, where, path);
  TextureSpec spec;
  reader.Get("pattern", spec.pattern, true).Get("size_m", spec.size_m);
  reader.Get("side_px", spec.side_px);
  GetSeed(reader, "seed", spec.seed);
  if (table.contains("first")) GetColour(reader, "first", spec.first);
  if (table.contains("second")) GetColour(reader, "second", spec.second);
  TSDFPP_RETURN_IF_ERROR(reader.Finish());
  return spec;
}

Expected<RoomSpec> ReadRoom(const toml::table& table, const std::string& where) {
  TomlReader reader(table, where, "room");
  RoomSpec room;
  reader.Get("table", room.table).Get("furniture", room.furniture);
  reader.Get("half_x", room.half_x).Get("half_y", room.half_y).Get("height", room.height);
  for (const auto& [key, texture] : {std::pair{"table_texture", &room.table_texture},
                                     std::pair{"floor_texture", &room.floor_texture},
                                     std::pair{"wall_texture", &room.wall_texture}}) {
    if (const toml::table* child = reader.Table(key)) {
      TSDFPP_ASSIGN(*texture, ReadTexture(*child, where, reader.PathOf(key)));
    }
  }
  TSDFPP_RETURN_IF_ERROR(reader.Finish());
  if (const auto valid = room.Validate(); !valid) {
    return UsageError("{}: room.{}", where, valid.error().message);
  }
  return room;
}

Expected<PhysicsSettings> ReadPhysicsSettings(const toml::table& table, const std::string& where) {
  TomlReader reader(table, where, "physics");
  PhysicsSettings physics;
  reader.Get("timestep_s", physics.timestep_s).Get("friction", physics.friction);
  CheckRange(reader, "timestep_s", physics.timestep_s, 1e-4, 0.005);
  CheckRange(reader, "friction", physics.friction, 0.0, 10.0);
  TSDFPP_RETURN_IF_ERROR(reader.Finish());
  return physics;
}

Expected<SceneExperiment> ReadExperiment(const toml::table& table, const std::string& where,
                                         const SceneConfig& config) {
  TomlReader reader(table, where, "experiment");
  SceneExperiment experiment;
  reader.Get("reveal_frame", experiment.reveal_frame, true);
  reader.Get("removed", experiment.removed, true);
  CheckRange(reader, "reveal_frame", experiment.reveal_frame, kFirstFrame, config.frames);
  if (experiment.removed.empty()) reader.Fault("removed", "names no object");
  for (const std::string& name : experiment.removed) {
    if (std::none_of(config.objects.begin(), config.objects.end(),
                     [&](const SceneObject& object) { return object.name == name; })) {
      reader.Fault("removed", fmt::format("names '{}', which is no object of this scene", name));
    }
    if (std::count(experiment.removed.begin(), experiment.removed.end(), name) > 1) {
      reader.Fault("removed", fmt::format("names '{}' twice", name));
    }
  }
  TSDFPP_RETURN_IF_ERROR(reader.Finish());
  return experiment;
}

}  // namespace

Expected<SceneConfig> ReadSceneConfig(const toml::table& root, const std::string& where,
                                      const SceneFolder& folder,
                                      std::optional<std::uint64_t> seed) {
  TomlReader reader(root, where);
  SceneConfig config;
  reader.Get("name", config.name, true).Get("purpose", config.purpose, true);
  reader.Get("frames", config.frames, true).Get("rate_hz", config.rate_hz, true);
  GetSeed(reader, "seed", config.seed);
  if (seed) config.seed = *seed;
  CheckPlainName(reader, config.name);
  CheckRange(reader, "frames", config.frames, 1, kMaxFrames);
  CheckRange(reader, "rate_hz", config.rate_hz, 0.1, 1000.0);
  const toml::table* camera = reader.Table("camera", true);
  const toml::table* room = reader.Table("room");
  const toml::table* lights = reader.Table("lights");
  const toml::table* physics = reader.Table("physics");
  const toml::table* sensor = reader.Table("sensor");
  const auto objects = reader.Tables("object");
  const toml::table* experiment = reader.Table("experiment");
  TSDFPP_RETURN_IF_ERROR(reader.Finish());

  if (room != nullptr) {
    TSDFPP_ASSIGN(config.room, ReadRoom(*room, where));
  }
  TSDFPP_RETURN_IF_ERROR(ReadCamera(*camera, where, folder, config));
  if (lights != nullptr) {
    TSDFPP_ASSIGN(config.lights, ReadLightRig(*lights, where, "lights"));
  }
  if (physics != nullptr) {
    TSDFPP_ASSIGN(config.physics, ReadPhysicsSettings(*physics, where));
  }
  if (sensor != nullptr) {
    TSDFPP_ASSIGN(config.sensor, ReadSensorConfig(*sensor, where));
    TSDFPP_RETURN_IF_ERROR(CheckSamples(config.sensor, config.intrinsics, where));
  }
  for (std::size_t i = 0; i < objects.size(); ++i) {
    TSDFPP_ASSIGN(
        SceneObject object,
        ReadSceneObject(*objects[i], where, fmt::format("object[{}]", i), folder, config));
    config.objects.push_back(std::move(object));
  }
  if (experiment != nullptr) {
    TSDFPP_ASSIGN(config.experiment, ReadExperiment(*experiment, where, config));
  }
  std::sort(config.objects.begin(), config.objects.end(),
            [](const SceneObject& a, const SceneObject& b) { return a.id < b.id; });
  return config;
}

Expected<SceneConfig> ParseSceneConfig(std::string_view text, std::string_view where,
                                       const SceneFolder& folder) {
  TSDFPP_ASSIGN(const toml::table root, ParseToml(text, where));
  return ReadSceneConfig(root, std::string(where), folder, std::nullopt);
}

}  // namespace tsdfpp
