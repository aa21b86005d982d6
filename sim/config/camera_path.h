// Where the camera is: on an arc, an orbit, a spline or a recorded trajectory, held steadily or by
// a hand.
#pragma once

#include <toml++/toml.h>

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "core/error.h"
#include "core/toml_reader.h"
#include "core/types.h"
#include "sim/config/scene_folder.h"
#include "sim/config/spline.h"

namespace tsdfpp {

inline constexpr int kFirstFrame = 1;

// The camera looks at `target` from a smooth path around the vertical axis through it. Keys are
// spread evenly over the frames; natural cubic splines join them.
struct ArcPath {
  Eigen::Vector3d target_W = Eigen::Vector3d::Zero();  // metres
  std::vector<double> azimuth_deg;  // of the camera seen from the target, from +x towards +y
  std::vector<double> radius_m;     // horizontal distance from the target
  std::vector<double> height_m;     // above the table's top
};

// Around the target at a steady speed.
struct OrbitPath {
  Eigen::Vector3d target_W = Eigen::Vector3d::Zero();
  double start_azimuth_deg = -90;
  double turns = 1;  // over all frames, negative: clockwise seen from above
  double radius_m = 1;
  double height_m = 0.5;  // above the table's top
};

// Position and target at some frames, joined by natural cubic splines; at rest before and after.
struct CameraKey {
  int frame = 0;
  Eigen::Vector3d position_W = Eigen::Vector3d::Zero();
  Eigen::Vector3d target_W = Eigen::Vector3d::Zero();
};
struct SplinePath {
  std::vector<CameraKey> keys;  // two at least
};

// A trajectory in TUM's format ("t tx ty tz qx qy qz qw", docs/sources.md, "TUM RGB-D"), sampled at
// the scene's rate (positions linearly, rotations by slerp). The file's world is moved so that its
// camera starts at `position`, looking at `target` with level rows.
struct RecordedPath {
  std::string file;    // absolute once a scene was loaded from a file
  double start_s = 0;  // after the file's first pose
  Eigen::Vector3d position_W = Eigen::Vector3d::Zero();
  Eigen::Vector3d target_W = Eigen::Vector3d::Zero();
};

using CameraPath = std::variant<ArcPath, OrbitPath, SplinePath, RecordedPath>;

// What a hand adds to a path: noise in the band between two frequencies, the slower the larger
// (amplitudes fall as 1/f), drawn from the scene's seed.
struct HandJitter {
  double position_mm = 3;     // standard deviation along each axis of the camera
  double rotation_deg = 0.3;  // standard deviation about each axis of the camera
  double lowest_hz = 0.5;
  double highest_hz = 6;
};

struct CameraConfig {
  CameraPath path;
  std::optional<HandJitter> jitter;
};

// Reads the keys of [camera] that say where it is; what is wrong becomes a fault of the reader, and
// returned where it is in a table of its own. A recorded trajectory lies in `folder`.
Expected<void> ReadCameraPath(TomlReader& reader, const SceneFolder& folder, CameraConfig& camera);
// Adds those keys to a table.
void WriteCameraPath(const CameraConfig& camera, toml::table& table);

class CameraMotion {
 public:
  // `seed` is the scene's. Errors: kData where a recorded trajectory is missing, unusable or too
  // short for the frames.
  static Expected<CameraMotion> Make(const CameraConfig& config, int frames, double rate_hz,
                                     std::uint64_t seed);

  // T_WC, looking along +z, at any moment between the first frame and the last; frame 1 is the
  // first. Without jitter, and but for recorded paths, the image's rows are level.
  Pose T_WC(double frame) const;

 private:
  struct Wave {
    double cycles_per_frame = 0;
    double phase = 0;
    double amplitude = 0;
  };

  Pose BasePose(double frame) const;
  void AddJitter(const HandJitter& jitter, double rate_hz, std::uint64_t seed);

  CameraPath path_;
  std::vector<CubicSpline> splines_;         // azimuth, radius, height; or position and target
  std::vector<Pose> recorded_;               // a frame
  std::array<std::vector<Wave>, 6> jitter_;  // position x y z (metres), rotation x y z (radians)
  int frames_ = 0;
};

// T_WC at `position_W`, looking at `target_W`, rows level. They must not be one above the other.
Pose LookAt(const Eigen::Vector3d& position_W, const Eigen::Vector3d& target_W);

}  // namespace tsdfpp
