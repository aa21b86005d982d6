#include "sim/scene_motion.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "sim/room_model.h"

namespace tsdfpp {
namespace {

constexpr double kRadians = std::numbers::pi / 180.0;
// Steps of the table of distances along a path: about a millimetre each.
constexpr int kDistanceSteps = 2000;

CubicSpline OverFrames(const std::vector<double>& values, int frames) {
  std::vector<double> knots(values.size());
  for (std::size_t i = 0; i < knots.size(); ++i) {
    knots[i] = kFirstFrame + static_cast<double>(i) * std::max(frames - 1, 1) /
                                 static_cast<double>(knots.size() - 1);
  }
  return {std::move(knots), values};
}

// The integral of smoothstep (3 u^2 - 2 u^3) from 0 to u, u in [0, 1].
double SmoothstepIntegral(double u) { return u * u * u - 0.5 * u * u * u * u; }

}  // namespace

ObjectMotion::ObjectMotion(const SceneObject& object, double rate_hz)
    : object_(object), rate_hz_(rate_hz) {
  if (!object.drive) return;
  std::vector<double> knots{0.0};
  std::vector<double> x{object.x};
  std::vector<double> y{object.y};
  for (std::size_t i = 0; i < object.drive->x.size(); ++i) {
    x.push_back(object.drive->x[i]);
    y.push_back(object.drive->y[i]);
    knots.push_back(knots.back() + std::hypot(x[i + 1] - x[i], y[i + 1] - y[i]));
  }
  last_parameter_ = knots.back();
  // Knots a chord apart make the curve's parameter close to its length, so a unit slope starts it
  // in the object's own heading.
  const double yaw = object.yaw_deg * kRadians;
  x_.emplace(knots, std::move(x), std::cos(yaw));
  y_.emplace(knots, std::move(y), std::sin(yaw));
  distance_at_.assign(kDistanceSteps + 1, 0.0);
  for (int i = 1; i <= kDistanceSteps; ++i) {
    const double step = last_parameter_ / kDistanceSteps;
    const double middle = (i - 0.5) * step;
    distance_at_[i] = distance_at_[i - 1] + step * std::hypot(x_->Slope(middle), y_->Slope(middle));
  }
  length_m_ = distance_at_.back();
}

double ObjectMotion::Distance(int frame) const {
  const DrivePath& drive = *object_.drive;
  const double duration = (drive.end_frame - drive.start_frame) / rate_hz_;
  const double t = std::clamp((frame - drive.start_frame) / rate_hz_, 0.0, duration);
  const double cruise = length_m_ / (duration - drive.ramp_s);
  const double ramp = drive.ramp_s;
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

Pose ObjectMotion::T_WO(int frame) const {
  double x = object_.x;
  double y = object_.y;
  double yaw = object_.yaw_deg * kRadians;
  if (object_.drive && frame > object_.drive->start_frame) {
    const double at = Parameter(Distance(frame));
    x = x_->Value(at);
    y = y_->Value(at);
    yaw = std::atan2(y_->Slope(at), x_->Slope(at));
  }
  Pose T_WO = Pose::Identity();
  T_WO.linear() = Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  T_WO.translation() = Eigen::Vector3d(x, y, kTableTop_m);
  return T_WO;
}

SceneMotion::SceneMotion(const SceneConfig& config)
    : path_(config.camera),
      azimuth_(OverFrames(config.camera.azimuth_deg, config.frames)),
      radius_(OverFrames(config.camera.radius_m, config.frames)),
      height_(OverFrames(config.camera.height_m, config.frames)) {
  for (const SceneObject& object : config.objects) {
    objects_.emplace(object.id, ObjectMotion(object, config.rate_hz));
  }
}

Pose SceneMotion::T_WC(int frame) const {
  const double azimuth = azimuth_.Value(frame) * kRadians;
  const double radius = radius_.Value(frame);
  const Eigen::Vector3d position(path_.target_W.x() + radius * std::cos(azimuth),
                                 path_.target_W.y() + radius * std::sin(azimuth),
                                 kTableTop_m + height_.Value(frame));
  const Eigen::Vector3d z = (path_.target_W - position).normalized();
  const Eigen::Vector3d x = z.cross(Eigen::Vector3d::UnitZ()).normalized();
  Pose T_WC = Pose::Identity();
  T_WC.linear().col(0) = x;
  T_WC.linear().col(1) = z.cross(x);
  T_WC.linear().col(2) = z;
  T_WC.translation() = position;
  return T_WC;
}

std::map<InstanceId, Pose> SceneMotion::T_WO(int frame) const {
  std::map<InstanceId, Pose> poses;
  for (const auto& [id, motion] : objects_) poses.emplace(id, motion.T_WO(frame));
  return poses;
}

}  // namespace tsdfpp
