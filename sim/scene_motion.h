// Where everything is at a frame: scripted, so any frame is known without the ones before it.
#pragma once

#include <map>

#include "core/types.h"
#include "sim/scene_config.h"
#include "sim/spline.h"

namespace tsdfpp {

// One object's path over the table.
class ObjectMotion {
 public:
  ObjectMotion(const SceneObject& object, double rate_hz);

  // T_WO at a frame (T_WO.translation() is on the table's top, +z up). The driven object never
  // stands still between its two frames; its speed ramps smoothly (a smoothstep over ramp_s).
  Pose T_WO(int frame) const;
  // Length of the whole path in metres, 0 for an object at rest.
  double length_m() const { return length_m_; }

 private:
  double Distance(int frame) const;
  double Parameter(double distance_m) const;

  SceneObject object_;
  double rate_hz_ = 30;
  double length_m_ = 0;
  std::optional<CubicSpline> x_;
  std::optional<CubicSpline> y_;
  std::vector<double> distance_at_;  // metres along the path at evenly spaced parameters
  double last_parameter_ = 0;
};

class SceneMotion {
 public:
  explicit SceneMotion(const SceneConfig& config);

  // T_WC of the camera, looking along +z at the target, x level.
  Pose T_WC(int frame) const;
  // T_WO of every object, those at rest included.
  std::map<InstanceId, Pose> T_WO(int frame) const;

 private:
  CameraPath path_;
  CubicSpline azimuth_;
  CubicSpline radius_;
  CubicSpline height_;
  std::map<InstanceId, ObjectMotion> objects_;
};

}  // namespace tsdfpp
