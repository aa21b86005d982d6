#include "sim/scene_config.h"

#include <algorithm>
#include <cmath>

#include "core/toml_reader.h"
#include "sim/room_model.h"
#include "sim/scene_motion.h"
#include "sim/toy_models.h"

namespace tsdfpp {
namespace {

constexpr int kMaxFrames = 100000;
constexpr int kMaxImageSide = 8192;
// How far the camera keeps from walls and ceiling: beyond the near clipping plane.
constexpr double kWallDistance_m = 0.15;

// Names become parts of file names, e.g. trajectories/gt-truck-1.txt.
bool IsPlainName(std::string_view name) {
  return !name.empty() && std::islower(static_cast<unsigned char>(name.front())) != 0 &&
         std::all_of(name.begin(), name.end(), [](unsigned char c) {
           return std::islower(c) != 0 || std::isdigit(c) != 0 || c == '_';
         });
}

template <typename T>
void CheckRange(TomlReader& reader, std::string_view key, T value, T low, T high) {
  if (!(value >= low && value <= high)) {
    reader.Fault(key, fmt::format("is {}, expected {} to {}", value, low, high));
  }
}

void CheckName(TomlReader& reader, std::string_view name) {
  if (!IsPlainName(name)) {
    reader.Fault("name", fmt::format("is '{}', expected lower-case letters, digits and '_'", name));
  }
}

void CheckOnTable(TomlReader& reader, std::string_view key, double value, double half_side) {
  if (std::abs(value) > half_side) {
    reader.Fault(key, fmt::format("has {}, which is off the table: expected {} to {} m", value,
                                  -half_side, half_side));
  }
}

Expected<void> ReadCamera(const toml::table& table, const std::string& where, SceneConfig& config) {
  TomlReader reader(table, where, "camera");
  Intrinsics& k = config.intrinsics;
  double f = 0;
  reader.Get("width", k.width, true).Get("height", k.height, true);
  reader.Get("f", f).Get("fx", k.fx).Get("fy", k.fy);
  reader.Get("cx", k.cx, true).Get("cy", k.cy, true);
  const bool has_f = table.contains("f");
  const bool has_fx = table.contains("fx");
  const bool has_fy = table.contains("fy");
  if (has_f && (has_fx || has_fy))
    reader.Fault("f", "stands beside fx or fy: give one or the other");
  if (!has_f && !(has_fx && has_fy)) reader.Fault("f", "is missing (or both fx and fy)");
  if (has_f) k.fx = k.fy = f;
  CheckRange(reader, "width", k.width, 1, kMaxImageSide);
  CheckRange(reader, "height", k.height, 1, kMaxImageSide);
  if (has_f && !(f > 0)) reader.Fault("f", fmt::format("is {}, expected a positive number", f));
  if (has_fx && !(k.fx > 0)) reader.Fault("fx", fmt::format("is {}, expected > 0", k.fx));
  if (has_fy && !(k.fy > 0)) reader.Fault("fy", fmt::format("is {}, expected > 0", k.fy));
  CheckRange(reader, "cx", k.cx, 0.0, static_cast<double>(k.width));
  CheckRange(reader, "cy", k.cy, 0.0, static_cast<double>(k.height));

  CameraPath& path = config.camera;
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
  TSDFPP_RETURN_IF_ERROR(reader.Finish());
  const SceneMotion motion(config);
  for (int frame = kFirstFrame; frame < kFirstFrame + config.frames; ++frame) {
    const Eigen::Vector3d at = motion.T_WC(frame).translation();
    const double kept = kWallDistance_m;
    if (std::abs(at.x()) > kRoomHalfX_m - kept || std::abs(at.y()) > kRoomHalfY_m - kept ||
        at.z() > kRoomHeight_m - kept) {
      reader.Fault("radius_m", fmt::format("and the other keys put the camera at ({:.2f}, {:.2f}, "
                                           "{:.2f}) m in frame {}, which is outside the room",
                                           at.x(), at.y(), at.z(), frame));
      break;
    }
  }
  return reader.Finish();
}

Expected<DrivePath> ReadDrive(const toml::table& table, const std::string& where,
                              const std::string& path, const SceneConfig& config) {
  TomlReader reader(table, where, path);
  DrivePath drive;
  reader.Get("start_frame", drive.start_frame, true).Get("end_frame", drive.end_frame, true);
  reader.Get("ramp_s", drive.ramp_s).Get("x", drive.x, true).Get("y", drive.y, true);
  CheckRange(reader, "start_frame", drive.start_frame, kFirstFrame, config.frames);
  if (drive.end_frame <= drive.start_frame) {
    reader.Fault("end_frame", fmt::format("is {}, expected more than start_frame ({})",
                                          drive.end_frame, drive.start_frame));
  }
  const double duration_s = (drive.end_frame - drive.start_frame) / config.rate_hz;
  CheckRange(reader, "ramp_s", drive.ramp_s, 0.0, duration_s / 2);
  if (drive.x.empty()) reader.Fault("x", "needs one waypoint at least");
  if (drive.x.size() != drive.y.size()) {
    reader.Fault("y", fmt::format("has {} numbers, x has {}", drive.y.size(), drive.x.size()));
  }
  for (const double x : drive.x) CheckOnTable(reader, "x", x, kTableHalfX_m);
  for (const double y : drive.y) CheckOnTable(reader, "y", y, kTableHalfY_m);
  TSDFPP_RETURN_IF_ERROR(reader.Finish());
  return drive;
}

// A spline needs waypoints that differ from their neighbours.
constexpr double kMinWaypointStep_m = 1e-3;

bool HasRepeatedWaypoint(const SceneObject& object) {
  Eigen::Vector2d last(object.x, object.y);
  for (std::size_t i = 0; i < object.drive->x.size(); ++i) {
    const Eigen::Vector2d next(object.drive->x[i], object.drive->y[i]);
    if ((next - last).norm() < kMinWaypointStep_m) return true;
    last = next;
  }
  return false;
}

Expected<SceneObject> ReadObject(const toml::table& table, const std::string& where,
                                 const std::string& path, const SceneConfig& config) {
  TomlReader reader(table, where, path);
  SceneObject object;
  int id = 0;
  reader.Get("name", object.name, true).Get("id", id, true);
  reader.Get("class", object.semantic_class, true).Get("model", object.model, true);
  reader.Get("x", object.x, true).Get("y", object.y, true).Get("yaw_deg", object.yaw_deg);
  CheckName(reader, object.name);
  if (object.name == "background") reader.Fault("name", "is 'background', which is id 0's name");
  CheckRange(reader, "id", id, 1, kMaxObjectId);
  object.id = static_cast<InstanceId>(id);
  for (const SceneObject& other : config.objects) {
    if (other.name == object.name) {
      reader.Fault("name", fmt::format("is '{}', which another object has already", object.name));
    }
    if (other.id == object.id) {
      reader.Fault("id", fmt::format("is {}, which '{}' has already", id, other.name));
    }
  }
  const std::vector<std::string>& models = ToyModelNames();
  if (std::find(models.begin(), models.end(), object.model) == models.end()) {
    reader.Fault("model", fmt::format("is '{}', expected one of: {}", object.model,
                                      fmt::join(models, ", ")));
  }
  CheckOnTable(reader, "x", object.x, kTableHalfX_m);
  CheckOnTable(reader, "y", object.y, kTableHalfY_m);
  const toml::table* drive = reader.Table("drive");
  TSDFPP_RETURN_IF_ERROR(reader.Finish());
  if (drive != nullptr) {
    TSDFPP_ASSIGN(object.drive, ReadDrive(*drive, where, path + ".drive", config));
    if (HasRepeatedWaypoint(object)) {
      TomlReader fault(*drive, where, path + ".drive");
      fault.Fault("x", "and 'y' name the same waypoint twice in a row");
      return tl::unexpected(fault.Finish().error());
    }
  }
  return object;
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

Expected<SceneConfig> ReadScene(const toml::table& root, const std::string& where) {
  TomlReader reader(root, where);
  SceneConfig config;
  reader.Get("name", config.name, true).Get("purpose", config.purpose, true);
  reader.Get("frames", config.frames, true).Get("rate_hz", config.rate_hz, true);
  CheckName(reader, config.name);
  CheckRange(reader, "frames", config.frames, 1, kMaxFrames);
  CheckRange(reader, "rate_hz", config.rate_hz, 0.1, 1000.0);
  const toml::table* camera = reader.Table("camera", true);
  const auto objects = reader.Tables("object");
  const toml::table* experiment = reader.Table("experiment");
  TSDFPP_RETURN_IF_ERROR(reader.Finish());

  TSDFPP_RETURN_IF_ERROR(ReadCamera(*camera, where, config));
  for (std::size_t i = 0; i < objects.size(); ++i) {
    TSDFPP_ASSIGN(SceneObject object,
                  ReadObject(*objects[i], where, fmt::format("object[{}]", i), config));
    config.objects.push_back(std::move(object));
  }
  if (experiment != nullptr) {
    TSDFPP_ASSIGN(config.experiment, ReadExperiment(*experiment, where, config));
  }
  std::sort(config.objects.begin(), config.objects.end(),
            [](const SceneObject& a, const SceneObject& b) { return a.id < b.id; });
  return config;
}

}  // namespace

Expected<SceneConfig> LoadSceneConfig(const std::filesystem::path& path) {
  TSDFPP_ASSIGN(const toml::table root, ParseTomlFile(path));
  return ReadScene(root, path.string());
}

Expected<SceneConfig> ParseSceneConfig(std::string_view text, std::string_view where) {
  TSDFPP_ASSIGN(const toml::table root, ParseToml(text, where));
  return ReadScene(root, std::string(where));
}

}  // namespace tsdfpp
