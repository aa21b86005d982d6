#include "sim/sensor/pose_noise.h"

#include "core/random.h"
#include "core/units.h"
#include "sim/sensor/sensor_streams.h"

namespace tsdfpp {
namespace {

Eigen::Vector3d Step(std::uint64_t seed, SensorStream stream, int frame) {
  const auto draw = GaussianDraw(seed, stream, static_cast<std::uint64_t>(frame));
  return {draw[0], draw[1], draw[2]};
}

}  // namespace

PoseError PoseDrift(const CameraPoseConfig& config, std::uint64_t seed, int frame, int first) {
  PoseError drift;
  if (config.drift_m == 0 && config.drift_deg == 0) return drift;
  for (int step = first + 1; step <= frame; ++step) {
    drift.translation_W += Step(seed, kStreamPoseDriftTranslation, step);
    drift.rotation_W += Step(seed, kStreamPoseDriftRotation, step);
  }
  drift.translation_W *= config.drift_m;
  drift.rotation_W *= config.drift_deg * kDegree;
  return drift;
}

PoseError PoseJitter(const CameraPoseConfig& config, std::uint64_t seed, int frame) {
  return {config.jitter_m * Step(seed, kStreamPoseJitterTranslation, frame),
          config.jitter_deg * kDegree * Step(seed, kStreamPoseJitterRotation, frame)};
}

Pose WithPoseError(const Pose& T_WC, const PoseError& error) {
  Pose result = T_WC;
  const double angle = error.rotation_W.norm();
  if (angle > 0) {
    const Eigen::AngleAxisd turn(angle, error.rotation_W / angle);
    result.linear() = turn.toRotationMatrix() * T_WC.linear();
  }
  result.translation() += error.translation_W;
  return result;
}

Pose SenseCameraPose(const CameraPoseConfig& config, std::uint64_t seed, int frame, int first,
                     const Pose& T_WC) {
  if (config == CameraPoseConfig{}) return T_WC;
  return WithPoseError(WithPoseError(T_WC, PoseJitter(config, seed, frame)),
                       PoseDrift(config, seed, frame, first));
}

}  // namespace tsdfpp
