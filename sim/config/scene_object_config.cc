#include "sim/config/scene_object_config.h"

#include <algorithm>
#include <cmath>

#include "core/toml_reader.h"
#include "sim/config/scene_readers.h"
#include "sim/config/toml_writer.h"

namespace tsdfpp {
namespace {

// A spline needs waypoints that differ from their neighbours.
constexpr double kMinWaypointStep_m = 1e-3;
constexpr double kMostSpeed = 20;         // metres a second
constexpr double kMostTurn_deg_s = 3600;  // degrees a second
constexpr double kMostMass_kg = 1000;

void CheckOnGround(TomlReader& reader, std::string_view key, double value, double half_side,
                   bool table) {
  if (std::abs(value) > half_side) {
    reader.Fault(key,
                 fmt::format("has {}, which is {}: expected {} to {} m", value,
                             table ? "off the table" : "outside the room", -half_side, half_side));
  }
}

Expected<DrivePath> ReadDrive(const toml::table& table, const std::string& where,
                              const std::string& path, const SceneObject& object,
                              const SceneConfig& config) {
  TomlReader reader(table, where, path);
  DrivePath drive;
  reader.Get("start_frame", drive.start_frame, true).Get("end_frame", drive.end_frame, true);
  reader.Get("ramp_s", drive.ramp_s).Get("x", drive.x, true).Get("y", drive.y, true);
  CheckRange(reader, "start_frame", drive.start_frame, kFirstFrame, config.frames);
  if (drive.end_frame <= drive.start_frame) {
    reader.Fault("end_frame", fmt::format("is {}, expected more than start_frame ({})",
                                          drive.end_frame, drive.start_frame));
  }
  const double duration_s =
      (static_cast<double>(drive.end_frame) - drive.start_frame) / config.rate_hz;
  CheckRange(reader, "ramp_s", drive.ramp_s, 0.0, duration_s / 2);
  if (drive.x.empty()) reader.Fault("x", "needs one waypoint at least");
  if (drive.x.size() != drive.y.size()) {
    reader.Fault("y", fmt::format("has {} numbers, x has {}", drive.y.size(), drive.x.size()));
  }
  const RoomSpec& room = config.room;
  for (const double x : drive.x) CheckOnGround(reader, "x", x, room.ground_half_x(), room.table);
  for (const double y : drive.y) CheckOnGround(reader, "y", y, room.ground_half_y(), room.table);
  TSDFPP_RETURN_IF_ERROR(reader.Finish());
  Eigen::Vector2d last(object.x, object.y);
  for (std::size_t i = 0; i < drive.x.size(); ++i) {
    const Eigen::Vector2d next(drive.x[i], drive.y[i]);
    if ((next - last).norm() < kMinWaypointStep_m) {
      reader.Fault("x", i == 0 ? "and 'y' begin at the object's own place, from which it drives off"
                               : "and 'y' name the same waypoint twice in a row");
    }
    last = next;
  }
  TSDFPP_RETURN_IF_ERROR(reader.Finish());
  return drive;
}

// A key that gives no position or no rotation keeps the one before it, the first key the object's.
Expected<std::vector<Keyframe>> ReadKeyframes(const std::vector<const toml::table*>& tables,
                                              const std::string& where, const std::string& path,
                                              const SceneObject& object,
                                              const SceneConfig& config) {
  std::vector<Keyframe> keys;
  Keyframe last;
  last.position_W = object.T_WO().translation();
  last.rotation_W = FromRollPitchYaw({object.roll_deg, object.pitch_deg, object.yaw_deg});
  for (std::size_t i = 0; i < tables.size(); ++i) {
    TomlReader reader(*tables[i], where, fmt::format("{}.keyframe[{}]", path, i));
    Keyframe key = last;
    reader.Get("frame", key.frame, true).Get("position", key.position_W);
    CheckRange(reader, "frame", key.frame, kFirstFrame, config.frames);
    const RoomSpec& room = config.room;
    const Eigen::Vector3d& at = key.position_W;
    if (!(std::abs(at.x()) <= room.half_x && std::abs(at.y()) <= room.half_y &&
          at.z() >= -room.height && at.z() <= room.height)) {
      reader.Fault(
          "position",
          fmt::format("is ({}, {}, {}), which is outside the room of {} x {} x "
                      "{} m",
                      at.x(), at.y(), at.z(), 2 * room.half_x, 2 * room.half_y, room.height));
    }
    if (!keys.empty() && key.frame <= last.frame) {
      reader.Fault("frame", fmt::format("is {}, expected more than the key before it ({})",
                                        key.frame, last.frame));
    }
    Eigen::Vector3d rpy_deg = Eigen::Vector3d::Zero();
    std::vector<double> q;
    reader.Get("rpy_deg", rpy_deg).Get("quaternion", q);
    const bool has_rpy = tables[i]->contains("rpy_deg");
    if (has_rpy) key.rotation_W = FromRollPitchYaw(rpy_deg);
    if (tables[i]->contains("quaternion")) {
      if (has_rpy) reader.Fault("quaternion", "stands beside rpy_deg: give one or the other");
      if (q.size() != 4) {
        reader.Fault("quaternion", fmt::format("has {} numbers, expected 4: x, y, z, w", q.size()));
      } else {
        key.rotation_W = Eigen::Quaterniond(q[3], q[0], q[1], q[2]);
        constexpr double kTolerance = 1e-3;
        if (std::abs(key.rotation_W.norm() - 1) > kTolerance) {
          reader.Fault("quaternion",
                       fmt::format("has length {}, expected 1", key.rotation_W.norm()));
        }
        // What is of unit length but for rounding stays as it is, so that a file that was written
        // reads back to the same numbers.
        constexpr double kRounding = 1e-12;
        if (std::abs(key.rotation_W.norm() - 1) > kRounding) key.rotation_W.normalize();
      }
    }
    TSDFPP_RETURN_IF_ERROR(reader.Finish());
    keys.push_back(key);
    last = key;
  }
  return keys;
}

Expected<ObjectPhysics> ReadPhysics(const toml::table& table, const std::string& where,
                                    const std::string& path, const SceneConfig& config) {
  TomlReader reader(table, where, path);
  ObjectPhysics physics;
  reader.Get("mass_kg", physics.mass_kg).Get("friction", physics.friction);
  reader.Get("rolling_friction_m", physics.rolling_friction_m);
  reader.Get("start_frame", physics.start_frame).Get("velocity", physics.velocity_W);
  reader.Get("angular_velocity_deg_s", physics.angular_velocity_W);
  CheckRange(reader, "mass_kg", physics.mass_kg, 1e-3, kMostMass_kg);
  CheckRange(reader, "friction", physics.friction, 0.0, 10.0);
  CheckRange(reader, "rolling_friction_m", physics.rolling_friction_m, 0.0, 0.1);
  CheckRange(reader, "start_frame", physics.start_frame, kFirstFrame, config.frames);
  if (physics.velocity_W.norm() > kMostSpeed) {
    reader.Fault("velocity", fmt::format("is {} m/s, expected {} at most",
                                         physics.velocity_W.norm(), kMostSpeed));
  }
  if (physics.angular_velocity_W.norm() > kMostTurn_deg_s) {
    reader.Fault("angular_velocity_deg_s",
                 fmt::format("is {} deg/s, expected {} at most", physics.angular_velocity_W.norm(),
                             kMostTurn_deg_s));
  }
  TSDFPP_RETURN_IF_ERROR(reader.Finish());
  return physics;
}

bool IsMeshFile(const std::string& name) {
  const std::string extension = std::filesystem::path(name).extension().string();
  return extension == ".obj" || extension == ".stl" || extension == ".ply";
}

void ReadModel(TomlReader& reader, const toml::table& table, const SceneFolder& folder,
               ModelSpec& model) {
  std::string name;
  std::string picture;
  reader.Get("model", name, true).Get("scale", model.scale).Get("material", model.material);
  reader.Get("up", model.up).Get("picture", picture);
  GetSeed(reader, "texture_seed", model.seed);
  if (table.contains("paint")) GetColour(reader, "paint", model.paint.emplace());
  if (table.contains("size")) {
    reader.Get("size", model.size_m.emplace(Eigen::Vector3d::Zero()));
  }
  model.name = name;
  if (IsMeshFile(name)) {
    model.name = kMeshModel;
    const auto file = folder.Find(reader, "model", name);
    if (!file) return;
    model.file = *file;
    if (!picture.empty()) {
      const auto found = folder.Find(reader, "picture", picture);
      if (!found) return;
      model.picture = *found;
    }
  } else if (!name.empty() && FindModel(name) == nullptr) {
    std::vector<std::string> names;
    for (const ModelInfo& info : ModelCatalogue()) names.push_back(info.name);
    reader.Fault("model", fmt::format("is '{}', expected one of: {}; or an .obj, .stl or .ply file",
                                      name, fmt::join(names, ", ")));
    return;
  } else if (!picture.empty()) {
    reader.Fault("picture", "is for models from files only");
  }
  if (const auto status = CheckModelSpec(model); !status) {
    reader.Fault("model", fmt::format("cannot be made: {}", status.error().message));
  }
}

}  // namespace

Pose SceneObject::T_WO() const {
  Pose pose = Pose::Identity();
  const double yaw = yaw_deg * (M_PI / 180.0);
  pose.linear() = Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  if (pitch_deg != 0 || roll_deg != 0) {
    pose.linear() = FromRollPitchYaw({roll_deg, pitch_deg, yaw_deg}).toRotationMatrix();
  }
  pose.translation() = Eigen::Vector3d(x, y, z);
  return pose;
}

Expected<SceneObject> ReadSceneObject(const toml::table& table, const std::string& where,
                                      const std::string& path, const SceneFolder& folder,
                                      const SceneConfig& so_far) {
  TomlReader reader(table, where, path);
  SceneObject object;
  int id = 0;
  reader.Get("name", object.name, true).Get("id", id, true);
  reader.Get("class", object.semantic_class, true);
  object.z = so_far.room.ground_m();
  reader.Get("x", object.x, true).Get("y", object.y, true).Get("z", object.z);
  reader.Get("yaw_deg", object.yaw_deg).Get("pitch_deg", object.pitch_deg);
  reader.Get("roll_deg", object.roll_deg);
  CheckPlainName(reader, object.name);
  if (object.name == "background") reader.Fault("name", "is 'background', which is id 0's name");
  CheckRange(reader, "id", id, 1, kMaxObjectId);
  object.id = static_cast<InstanceId>(id);
  for (const SceneObject& other : so_far.objects) {
    if (other.name == object.name) {
      reader.Fault("name", fmt::format("is '{}', which another object has already", object.name));
    }
    if (other.id == object.id) {
      reader.Fault("id", fmt::format("is {}, which '{}' has already", id, other.name));
    }
  }
  ReadModel(reader, table, folder, object.model);
  const RoomSpec& room = so_far.room;
  // What is not on the ground may be anywhere in the room.
  const bool on_table = room.table && !table.contains("z");
  CheckOnGround(reader, "x", object.x, on_table ? kTableHalfX_m : room.half_x, on_table);
  CheckOnGround(reader, "y", object.y, on_table ? kTableHalfY_m : room.half_y, on_table);
  CheckRange(reader, "z", object.z, 0.0, room.height);
  const toml::table* drive = reader.Table("drive");
  const auto keyframes = reader.Tables("keyframe");
  const toml::table* physics = reader.Table("physics");
  const int motions =
      (drive != nullptr ? 1 : 0) + (keyframes.empty() ? 0 : 1) + (physics != nullptr ? 1 : 0);
  if (motions > 1) reader.Fault("name", "has more than one of: drive, keyframe, physics");
  if (keyframes.size() == 1) reader.Fault("keyframe", "needs two at least");
  if (drive != nullptr && (object.pitch_deg != 0 || object.roll_deg != 0)) {
    reader.Fault("drive", "is for objects that stand upright: pitch_deg and roll_deg must be 0");
  }
  TSDFPP_RETURN_IF_ERROR(reader.Finish());
  if (drive != nullptr) {
    TSDFPP_ASSIGN(object.drive, ReadDrive(*drive, where, path + ".drive", object, so_far));
  }
  TSDFPP_ASSIGN(object.keyframes, ReadKeyframes(keyframes, where, path, object, so_far));
  if (physics != nullptr) {
    TSDFPP_ASSIGN(object.physics, ReadPhysics(*physics, where, path + ".physics", so_far));
  }
  return object;
}

toml::table SceneObjectToToml(const SceneObject& object) {
  const ModelSpec& model = object.model;
  const bool is_file = model.name == kMeshModel;
  toml::table table{{"name", object.name},
                    {"id", static_cast<int>(object.id)},
                    {"class", object.semantic_class},
                    {"model", is_file ? model.file.string() : model.name},
                    {"scale", model.scale},
                    {"texture_seed", static_cast<std::int64_t>(model.seed)},
                    {"x", object.x},
                    {"y", object.y},
                    {"z", object.z},
                    {"yaw_deg", object.yaw_deg},
                    {"pitch_deg", object.pitch_deg},
                    {"roll_deg", object.roll_deg}};
  if (!model.material.empty()) table.insert("material", model.material);
  if (model.paint) {
    table.insert("paint", toml::array{(*model.paint)[0], (*model.paint)[1], (*model.paint)[2]});
  }
  if (model.size_m) table.insert("size", TomlArray(*model.size_m));
  if (is_file) table.insert("up", model.up);
  if (!model.picture.empty()) table.insert("picture", model.picture.string());
  if (object.drive) {
    table.insert("drive", toml::table{{"start_frame", object.drive->start_frame},
                                      {"end_frame", object.drive->end_frame},
                                      {"ramp_s", object.drive->ramp_s},
                                      {"x", TomlArray(object.drive->x)},
                                      {"y", TomlArray(object.drive->y)}});
  }
  toml::array keys;
  for (const Keyframe& key : object.keyframes) {
    const Eigen::Vector4d q = key.rotation_W.coeffs();
    keys.push_back(toml::table{{"frame", key.frame},
                               {"position", TomlArray(key.position_W)},
                               {"quaternion", toml::array{q[0], q[1], q[2], q[3]}}});
  }
  if (!keys.empty()) table.insert("keyframe", std::move(keys));
  if (object.physics) {
    const ObjectPhysics& physics = *object.physics;
    table.insert("physics",
                 toml::table{{"mass_kg", physics.mass_kg},
                             {"friction", physics.friction},
                             {"rolling_friction_m", physics.rolling_friction_m},
                             {"start_frame", physics.start_frame},
                             {"velocity", TomlArray(physics.velocity_W)},
                             {"angular_velocity_deg_s", TomlArray(physics.angular_velocity_W)}});
  }
  return table;
}

}  // namespace tsdfpp
