// What a scene file (scenes/*.toml) says: camera, objects, motion, the paper's experiment.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/error.h"
#include "core/types.h"

namespace tsdfpp {

// The camera looks at `target` from a smooth path around the table's vertical axis through it. Keys
// are spread evenly over the frames; natural cubic splines join them.
struct CameraPath {
  Eigen::Vector3d target_W = Eigen::Vector3d::Zero();  // metres
  std::vector<double> azimuth_deg;  // of the camera seen from the target, from +x towards +y
  std::vector<double> radius_m;     // horizontal distance from the target
  std::vector<double> height_m;     // above the table's top
};

// At rest up to `start_frame`, then along a curve whose tangent the object's front (+x) follows,
// at rest again from `end_frame` on. The curve starts at the object's own place and heading.
struct DrivePath {
  int start_frame = 0;
  int end_frame = 0;
  double ramp_s = 1.0;    // time from rest to cruising speed and back
  std::vector<double> x;  // waypoints after the start, metres, world frame
  std::vector<double> y;
};

struct SceneObject {
  std::string name;
  InstanceId id = kNoInstance;
  std::string semantic_class;
  std::string model;  // one of ToyModelNames()
  double x = 0;       // metres, world frame, on the table
  double y = 0;
  double yaw_deg = 0;  // heading of the object's +x from the world's +x
  std::optional<DrivePath> drive;
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
  Intrinsics intrinsics;
  CameraPath camera;
  std::vector<SceneObject> objects;  // ordered by id
  std::optional<SceneExperiment> experiment;
};

inline constexpr int kFirstFrame = 1;
// Ids are written to 8-bit masks (facts/datasets.md).
inline constexpr int kMaxObjectId = 255;

// Errors: kUsage, with the file and line: not TOML, a key that is unknown, missing, of the wrong
// type or out of range, names or ids given twice, a model that does not exist, a removed object
// that is not in the scene.
Expected<SceneConfig> LoadSceneConfig(const std::filesystem::path& path);
// The same from text; `where` stands for the file's name in messages.
Expected<SceneConfig> ParseSceneConfig(std::string_view text, std::string_view where);

}  // namespace tsdfpp
