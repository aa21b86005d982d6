// Errors of the given camera pose: drift and jitter. Formulae in docs/sensors.md.
#pragma once

#include <cstdint>

#include "core/types.h"
#include "sim/config/sensor_config.h"

namespace tsdfpp {

// An error of the camera's place and heading. The given pose turns the true one by `rotation_W`
// about the camera's own centre and moves it by `translation_W`, both in the world's axes.
struct PoseError {
  Eigen::Vector3d translation_W = Eigen::Vector3d::Zero();  // metres
  Eigen::Vector3d rotation_W = Eigen::Vector3d::Zero();     // rotation vector, radians
};

// The drift of a frame: the sum of one keyed normal step an axis for each frame after `first` up to
// `frame`, so that it needs no earlier frame; zero up to the first frame. Its standard deviation is
// sqrt(frame - first) times drift_m (metres) and drift_deg (degrees) an axis.
PoseError PoseDrift(const CameraPoseConfig& config, std::uint64_t seed, int frame, int first);

// The jitter of a frame alone.
PoseError PoseJitter(const CameraPoseConfig& config, std::uint64_t seed, int frame);

// exp(rotation) * R and t + translation; the very pose where the error is zero.
Pose WithPoseError(const Pose& T_WC, const PoseError& error);

// The pose that the sensor gives for T_WC: jitter, then drift.
Pose SenseCameraPose(const CameraPoseConfig& config, std::uint64_t seed, int frame, int first,
                     const Pose& T_WC);

}  // namespace tsdfpp
