#include "sim/motion/scene_motion.h"

#include "sim/motion/physics_bake.h"

namespace tsdfpp {

Expected<SceneMotion> SceneMotion::Make(const SceneConfig& config) {
  SceneMotion motion;
  motion.frames_ = config.frames;
  TSDFPP_ASSIGN(motion.camera_,
                CameraMotion::Make(config.camera, config.frames, config.rate_hz, config.seed));
  TSDFPP_ASSIGN(motion.table_.T_WO, BakePhysics(config));
  for (const SceneObject& object : config.objects) {
    if (!object.physics) motion.objects_.emplace(object.id, ObjectMotion(object, config.rate_hz));
  }
  return motion;
}

Expected<SceneMotion> SceneMotion::FromFolder(const SceneConfig& config,
                                              const std::filesystem::path& folder) {
  SceneMotion motion;
  motion.frames_ = config.frames;
  std::vector<ObjectInfo> objects;
  for (const SceneObject& object : config.objects) {
    objects.push_back({object.id, object.name, object.semantic_class});
  }
  TSDFPP_ASSIGN(motion.table_, ReadPoseFolder(folder, objects, config.frames));
  return motion;
}

Pose SceneMotion::T_WC(double frame) const {
  return camera_ ? camera_->T_WC(frame) : PoseAt(table_.T_WC, frame - kFirstFrame);
}

std::map<InstanceId, Pose> SceneMotion::T_WO(double frame) const {
  std::map<InstanceId, Pose> poses;
  for (const auto& [id, motion] : objects_) poses.emplace(id, motion.T_WO(frame));
  for (const auto& [id, baked] : table_.T_WO) poses.emplace(id, PoseAt(baked, frame - kFirstFrame));
  return poses;
}

PoseTable SceneMotion::Table() const {
  PoseTable table;
  for (int frame = kFirstFrame; frame < kFirstFrame + frames_; ++frame) {
    table.T_WC.push_back(T_WC(frame));
    for (const auto& [id, pose] : T_WO(frame)) table.T_WO[id].push_back(pose);
  }
  return table;
}

}  // namespace tsdfpp
