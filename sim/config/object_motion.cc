#include "sim/config/object_motion.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "sim/config/scene_config.h"

namespace tsdfpp {
namespace {

constexpr double kRadians = std::numbers::pi / 180.0;
// Steps of the table of distances along a path: about a millimetre each.
constexpr int kDistanceSteps = 2000;

// The integral of smoothstep (3 u^2 - 2 u^3) from 0 to u, u in [0, 1].
double SmoothstepIntegral(double u) { return u * u * u - 0.5 * u * u * u * u; }

}  // namespace

Eigen::Quaterniond FromRollPitchYaw(const Eigen::Vector3d& rpy_deg) {
  const Eigen::Vector3d rpy = rpy_deg * kRadians;
  return Eigen::AngleAxisd(rpy.z(), Eigen::Vector3d::UnitZ()) *
         Eigen::AngleAxisd(rpy.y(), Eigen::Vector3d::UnitY()) *
         Eigen::AngleAxisd(rpy.x(), Eigen::Vector3d::UnitX());
}

ObjectMotion::ObjectMotion(const SceneObject& object, double rate_hz)
    : start_(object.T_WO()), rate_hz_(rate_hz), drive_(object.drive) {
  if (drive_) MakeDrive(object);
  if (!object.keyframes.empty()) MakeKeyframes(object.keyframes);
}

void ObjectMotion::MakeDrive(const SceneObject& object) {
  std::vector<double> knots{0.0};
  std::vector<double> x{object.x};
  std::vector<double> y{object.y};
  for (std::size_t i = 0; i < drive_->x.size(); ++i) {
    x.push_back(drive_->x[i]);
    y.push_back(drive_->y[i]);
    knots.push_back(knots.back() + std::hypot(x[i + 1] - x[i], y[i + 1] - y[i]));
  }
  last_parameter_ = knots.back();
  // Knots a chord apart make the curve's parameter close to its length, so a unit slope starts it
  // in the object's own heading.
  const double yaw = object.yaw_deg * kRadians;
  xy_.emplace_back(knots, std::move(x), std::cos(yaw));
  xy_.emplace_back(knots, std::move(y), std::sin(yaw));
  distance_at_.assign(kDistanceSteps + 1, 0.0);
  for (int i = 1; i <= kDistanceSteps; ++i) {
    const double step = last_parameter_ / kDistanceSteps;
    const double middle = (i - 0.5) * step;
    distance_at_[i] =
        distance_at_[i - 1] + step * std::hypot(xy_[0].Slope(middle), xy_[1].Slope(middle));
  }
  length_m_ = distance_at_.back();
}

void ObjectMotion::MakeKeyframes(const std::vector<Keyframe>& keys) {
  std::vector<double> knots;
  std::vector<Eigen::Quaterniond> rotations;
  for (const Keyframe& key : keys) {
    knots.push_back(key.frame);
    rotations.push_back(key.rotation_W);
  }
  for (int k = 0; k < 3; ++k) {
    std::vector<double> values;
    for (const Keyframe& key : keys) values.push_back(key.position_W[k]);
    position_.emplace_back(knots, std::move(values));
  }
  rotation_.emplace(std::move(knots), std::move(rotations));
}

double ObjectMotion::Distance(double frame) const {
  const double duration = (drive_->end_frame - drive_->start_frame) / rate_hz_;
  const double t = std::clamp((frame - drive_->start_frame) / rate_hz_, 0.0, duration);
  const double cruise = length_m_ / (duration - drive_->ramp_s);
  const double ramp = drive_->ramp_s;
  if (t < ramp) return cruise * ramp * SmoothstepIntegral(t / ramp);
  if (t <= duration - ramp) return cruise * (t - ramp / 2);
  return length_m_ - cruise * ramp * SmoothstepIntegral((duration - t) / ramp);
}

double ObjectMotion::Parameter(double distance_m) const {
  const auto above = std::upper_bound(distance_at_.begin() + 1, distance_at_.end() - 1, distance_m);
  const auto i = static_cast<double>(above - distance_at_.begin());
  const double low = *(above - 1);
  const double part = (distance_m - low) / (*above - low);
  return last_parameter_ / kDistanceSteps * (i - 1 + part);
}

Pose ObjectMotion::T_WO(double frame) const {
  Pose T_WO = start_;
  if (drive_ && frame > drive_->start_frame) {
    const double at = Parameter(Distance(frame));
    const double yaw = std::atan2(xy_[1].Slope(at), xy_[0].Slope(at));
    T_WO.linear() = Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()).toRotationMatrix();
    T_WO.translation() =
        Eigen::Vector3d(xy_[0].Value(at), xy_[1].Value(at), start_.translation().z());
  } else if (rotation_) {
    T_WO.linear() = rotation_->Value(frame).toRotationMatrix();
    for (int k = 0; k < 3; ++k) T_WO.translation()[k] = position_[k].Value(frame);
  }
  return T_WO;
}

}  // namespace tsdfpp
