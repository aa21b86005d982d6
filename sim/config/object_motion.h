// Where one object is at a moment: at rest, driven over its ground, or carried from key to key.
#pragma once

#include <optional>
#include <vector>

#include "core/types.h"
#include "sim/config/spline.h"

namespace tsdfpp {

// At rest up to `start_frame`, then along a curve whose tangent the object's front (+x) follows,
// at rest again from `end_frame` on. The curve starts at the object's own place and heading and
// stays at its height.
struct DrivePath {
  int start_frame = 0;
  int end_frame = 0;
  double ramp_s = 1.0;    // time from rest to cruising speed and back
  std::vector<double> x;  // waypoints after the start, metres, world frame
  std::vector<double> y;
};

// Where an object is at a frame. Between two keys it moves smoothly (spline.h), turning by the
// shorter way, so a whole turn needs keys on its way; before the first and after the last it rests.
struct Keyframe {
  int frame = 0;
  Eigen::Vector3d position_W = Eigen::Vector3d::Zero();
  Eigen::Quaterniond rotation_W = Eigen::Quaterniond::Identity();
};

struct SceneObject;

// Scripted motion: any moment is known without the ones before it.
class ObjectMotion {
 public:
  // An object of physics stays at its own place here (physics_bake.h has where it goes).
  ObjectMotion(const SceneObject& object, double rate_hz);

  // T_WO at a frame, fractions included. The driven object never stands still between its two
  // frames; its speed ramps smoothly (a smoothstep over ramp_s).
  Pose T_WO(double frame) const;
  // Length of the whole driven path in metres, 0 for another motion.
  double length_m() const { return length_m_; }

 private:
  double Distance(double frame) const;
  double Parameter(double distance_m) const;
  void MakeDrive(const SceneObject& object);
  void MakeKeyframes(const std::vector<Keyframe>& keys);

  Pose start_ = Pose::Identity();
  double rate_hz_ = 30;
  std::optional<DrivePath> drive_;
  double length_m_ = 0;
  std::vector<CubicSpline> xy_;
  std::vector<double> distance_at_;  // metres along the path at evenly spaced parameters
  double last_parameter_ = 0;
  std::vector<RestingSpline> position_;  // x, y, z over frames
  std::optional<RotationSpline> rotation_;
};

// The rotation Rz(yaw) Ry(pitch) Rx(roll).
Eigen::Quaterniond FromRollPitchYaw(const Eigen::Vector3d& rpy_deg);

}  // namespace tsdfpp
