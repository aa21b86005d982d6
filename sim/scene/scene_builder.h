// Composes a scene with mjSpec and compiles it.
#pragma once

#include <mujoco/mujoco.h>

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/types.h"
#include "sim/config/scene_config.h"

namespace tsdfpp {

struct MujocoDeleter {
  void operator()(mjModel* model) const { mj_deleteModel(model); }
  void operator()(mjData* data) const { mj_deleteData(data); }
  void operator()(mjSpec* spec) const { mj_deleteSpec(spec); }
};

// Clipping planes of the camera, metres. Pinned (with an extent of one metre), because MuJoCo
// scales both by an extent that it derives from the model, and depth read-back depends on them.
inline constexpr double kNear_m = 0.1;
inline constexpr double kFar_m = 10.0;

// What one geom of the compiled model is.
struct GeomInfo {
  InstanceId id = kBackground;
  std::string region;
  Colour colour{};  // the mean colour of its texture where it has one
};

// A compiled scene and its state. Every object is a mocap body; the room belongs to the world body.
class CompiledScene {
 public:
  // Errors: those of MakeModel; kEnvironment where MuJoCo refuses the model, with its words.
  static Expected<CompiledScene> Compile(const SceneConfig& config);

  // Moves the objects: T_WO of every one. Lights and geoms follow.
  void SetPoses(const std::map<InstanceId, Pose>& T_WO);

  // The surfaces as compiled (MuJoCo re-centres meshes), hence as rendered: each object in its own
  // frame, the background first and in the world's; per-vertex colours, regions per face.
  std::vector<TrueModel> TrueModels() const;

  const mjModel* model() const { return model_.get(); }
  mjModel* model() { return model_.get(); }
  mjData* data() { return data_.get(); }
  const std::vector<GeomInfo>& geoms() const { return geoms_; }        // by geom id
  const std::vector<ObjectInfo>& objects() const { return objects_; }  // background first

 private:
  std::unique_ptr<mjModel, MujocoDeleter> model_;
  std::unique_ptr<mjData, MujocoDeleter> data_;
  std::vector<GeomInfo> geoms_;
  std::vector<ObjectInfo> objects_;
  std::map<InstanceId, int> mocap_;  // index into mjData's mocap arrays
};

}  // namespace tsdfpp
