// Where everything is at a frame. What physics moves is simulated first, whole, so that afterwards
// any frame is known without the ones before it.
#pragma once

#include <filesystem>
#include <map>
#include <optional>

#include "core/error.h"
#include "core/types.h"
#include "sim/config/camera_path.h"
#include "sim/config/object_motion.h"
#include "sim/config/scene_config.h"
#include "sim/config/trajectory_folder.h"

namespace tsdfpp {

class SceneMotion {
 public:
  // Bakes the physics of a scene that has some (physics_bake.h). Errors: those of
  // CameraMotion::Make and BakePhysics.
  static Expected<SceneMotion> Make(const SceneConfig& config);
  // All poses, the camera's too, from trajectories written before (trajectory_folder.h); the
  // scene's own motion is not used. Errors: kData.
  static Expected<SceneMotion> FromFolder(const SceneConfig& config,
                                          const std::filesystem::path& folder);

  // T_WC of the camera, looking along +z. Fractions of frames are allowed (sub-frame poses of
  // motion blur and rolling shutter); poses that were baked or read are interpolated there.
  Pose T_WC(double frame) const;
  // T_WO of every object, those at rest included.
  std::map<InstanceId, Pose> T_WO(double frame) const;
  // The poses of all frames.
  PoseTable Table() const;

 private:
  int frames_ = 0;
  std::optional<CameraMotion> camera_;          // unless `table_` has it
  std::map<InstanceId, ObjectMotion> objects_;  // those that `table_` does not have
  PoseTable table_;                             // baked, or read from a folder
};

}  // namespace tsdfpp
