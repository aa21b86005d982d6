// A scene as a TOML file.

#include "sim/config/scene_config.h"
#include "sim/config/scene_object_config.h"
#include "sim/config/toml_writer.h"

namespace tsdfpp {
namespace {

toml::array ColourArray(const Colour& colour) {
  return toml::array{colour[0], colour[1], colour[2]};
}

toml::table TextureTable(const TextureSpec& spec) {
  return toml::table{{"pattern", spec.pattern},
                     {"seed", static_cast<std::int64_t>(spec.seed)},
                     {"first", ColourArray(spec.first)},
                     {"second", ColourArray(spec.second)},
                     {"size_m", spec.size_m},
                     {"side_px", spec.side_px}};
}

toml::table CameraTable(const SceneConfig& config) {
  const Intrinsics& k = config.intrinsics;
  toml::table camera{{"width", k.width}, {"height", k.height}, {"fx", k.fx},
                     {"fy", k.fy},       {"cx", k.cx},         {"cy", k.cy}};
  WriteCameraPath(config.camera, camera);
  return camera;
}

toml::table RoomTable(const RoomSpec& spec) {
  toml::table room{{"table", spec.table},
                   {"furniture", spec.furniture},
                   {"half_x", spec.half_x},
                   {"half_y", spec.half_y},
                   {"height", spec.height}};
  if (spec.table_texture) room.insert("table_texture", TextureTable(*spec.table_texture));
  if (spec.floor_texture) room.insert("floor_texture", TextureTable(*spec.floor_texture));
  if (spec.wall_texture) room.insert("wall_texture", TextureTable(*spec.wall_texture));
  return room;
}

}  // namespace

std::string SceneToToml(const SceneConfig& config) {
  // TOML tables have no order of their own; what a reader looks for first is written first.
  std::string text;
  const auto write = [&](const toml::table& table) { text += TomlText(table) + "\n\n"; };
  write(toml::table{{"name", config.name}});
  write(toml::table{{"purpose", config.purpose}});
  write(toml::table{{"frames", config.frames},
                    {"rate_hz", config.rate_hz},
                    {"seed", static_cast<std::int64_t>(config.seed)}});
  write(toml::table{{"camera", CameraTable(config)}});
  write(toml::table{{"room", RoomTable(config.room)}});
  write(toml::table{{"lights", config.lights.ToToml()}});
  write(toml::table{{"physics", toml::table{{"timestep_s", config.physics.timestep_s},
                                            {"friction", config.physics.friction}}}});
  for (const SceneObject& object : config.objects) {
    write(toml::table{{"object", toml::array{SceneObjectToToml(object)}}});
  }
  if (config.sensor != SensorConfig{}) text += SensorConfigToToml(config.sensor) + "\n";
  if (config.experiment) {
    write(toml::table{
        {"experiment", toml::table{{"reveal_frame", config.experiment->reveal_frame},
                                   {"removed", TomlArray(config.experiment->removed)}}}});
  }
  return text;
}

}  // namespace tsdfpp
