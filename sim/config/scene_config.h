// What a scene file (scenes/*.toml) says: room, lights, camera, objects, motion, the paper's
// experiment.
#pragma once

#include <toml++/toml.h>

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/error.h"
#include "core/types.h"
#include "sim/config/camera_path.h"
#include "sim/config/light_rig.h"
#include "sim/config/object_motion.h"
#include "sim/config/sensor_config.h"
#include "sim/models/model_catalogue.h"
#include "sim/models/room_model.h"

namespace tsdfpp {

// An object that physics moves (physics_bake.h).
struct ObjectPhysics {
  double mass_kg = 0.2;
  double friction = 0.5;             // Coulomb's; the larger one where two such objects meet
  double rolling_friction_m = 3e-4;  // torque that brakes rolling, a newton of load
  int start_frame = 1;               // held at its place until then
  Eigen::Vector3d velocity_W = Eigen::Vector3d::Zero();  // metres a second, of its middle, then
  Eigen::Vector3d angular_velocity_W = Eigen::Vector3d::Zero();  // degrees a second, then
};

struct SceneObject {
  std::string name;
  InstanceId id = kNoInstance;
  std::string semantic_class;
  ModelSpec model;
  double x = 0;  // metres, world frame, of the model's origin
  double y = 0;
  double z = kTableTop_m;
  double yaw_deg = 0;  // heading of the object's +x from the world's +x
  double pitch_deg = 0;
  double roll_deg = 0;
  // At most one of these; an object without any rests.
  std::optional<DrivePath> drive;
  std::vector<Keyframe> keyframes;  // none, or two at least
  std::optional<ObjectPhysics> physics;

  // Where it is before anything moves: Rz(yaw) Ry(pitch) Rx(roll).
  Pose T_WO() const;
};

struct PhysicsSettings {
  double timestep_s = 0.001;  // rounded down so that a frame has a whole number of steps
  // Of the room and of objects that physics does not move: no contact's, since those of objects
  // that it moves go before.
  double friction = 0.3;
};

struct SceneExperiment {
  int reveal_frame = 0;
  std::vector<std::string> removed;  // names of objects
};

struct SceneConfig {
  std::string name;
  std::string purpose;  // one sentence
  int frames = 0;       // numbered from 1
  double rate_hz = 30;
  std::uint64_t seed = 1;  // of all that is drawn when the scene is run: jitter, sensor
  Intrinsics intrinsics;
  CameraConfig camera;
  RoomSpec room;
  LightRig lights = DefaultLightRig();
  PhysicsSettings physics;
  SensorConfig sensor;
  std::vector<SceneObject> objects;  // ordered by id
  std::optional<SceneExperiment> experiment;
};

// Ids are written to 8-bit masks (docs/sources.md, "Co-Fusion").
inline constexpr int kMaxObjectId = 255;

// Reads a scene that is not random. Names of files in it are relative to `folder`; `where` stands
// for the file's name in messages; `seed` takes the place of the file's own. Errors: those of
// LoadSceneConfig (sim/load_scene.h).
Expected<SceneConfig> ReadSceneConfig(const toml::table& root, const std::string& where,
                                      const SceneFolder& folder, std::optional<std::uint64_t> seed);
// The same from text; `where` stands for the file's name in messages, `folder` is where the names
// of files in it start (empty: the working directory).
Expected<SceneConfig> ParseSceneConfig(std::string_view text, std::string_view where,
                                       const SceneFolder& folder = {});

// The scene as a file: ParseSceneConfig(SceneToToml(c)) is c, number by number.
std::string SceneToToml(const SceneConfig& config);

}  // namespace tsdfpp
