#include "sim/config/camera_path.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/random.h"
#include "sim/config/trajectory_folder.h"
#include "sim/models/room_model.h"

namespace tsdfpp {
namespace {

constexpr double kRadians = std::numbers::pi / 180.0;
// Of the noise of one axis: enough that its distribution is close to normal.
constexpr int kJitterWaves = 16;
// Streams of random numbers of the jitter, one an axis (core/random.h).
constexpr std::uint32_t kJitterStream = 0x4A490000;

CubicSpline OverFrames(const std::vector<double>& values, int frames) {
  std::vector<double> knots(values.size());
  for (std::size_t i = 0; i < knots.size(); ++i) {
    knots[i] = kFirstFrame + static_cast<double>(i) * std::max(frames - 1, 1) /
                                 static_cast<double>(knots.size() - 1);
  }
  return {std::move(knots), values};
}

// The poses of a recorded trajectory at the scene's frames, moved to where the scene wants them.
Expected<std::vector<Pose>> Sample(const RecordedPath& path, int frames, double rate_hz) {
  TSDFPP_ASSIGN(const std::vector<TimedPose> recorded, ReadTumTrajectory(path.file));
  const double first = recorded.front().time_s + path.start_s;
  const double last = first + (frames - 1) / rate_hz;
  // A trajectory's times are often rounded to tens of microseconds.
  constexpr double kSlack_s = 1e-3;
  if (path.start_s < 0 || recorded.back().time_s + kSlack_s < last) {
    return DataError(
        "{}: lasts {:.3f} s, but the scene needs {:.3f} s from {:.3f} s after its first pose",
        path.file, recorded.back().time_s - recorded.front().time_s, (frames - 1) / rate_hz,
        path.start_s);
  }
  std::vector<Pose> poses;
  std::size_t i = 0;
  for (int frame = 0; frame < frames; ++frame) {
    const double t = std::min(first + frame / rate_hz, recorded.back().time_s);
    while (i + 2 < recorded.size() && recorded[i + 1].time_s <= t) ++i;
    const TimedPose& a = recorded[i];
    const TimedPose& b = recorded[i + 1];
    poses.push_back(Interpolate(a.pose, b.pose, (t - a.time_s) / (b.time_s - a.time_s)));
  }
  const Pose T_WF = LookAt(path.position_W, path.target_W) * poses.front().inverse();
  for (Pose& pose : poses) pose = T_WF * pose;
  return poses;
}

}  // namespace

Pose LookAt(const Eigen::Vector3d& position_W, const Eigen::Vector3d& target_W) {
  const Eigen::Vector3d z = (target_W - position_W).normalized();
  const Eigen::Vector3d x = z.cross(Eigen::Vector3d::UnitZ()).normalized();
  Pose T_WC = Pose::Identity();
  T_WC.linear().col(0) = x;
  T_WC.linear().col(1) = z.cross(x);
  T_WC.linear().col(2) = z;
  T_WC.translation() = position_W;
  return T_WC;
}

Expected<CameraMotion> CameraMotion::Make(const CameraConfig& config, int frames, double rate_hz,
                                          std::uint64_t seed) {
  CameraMotion motion;
  motion.path_ = config.path;
  motion.frames_ = frames;
  if (const auto* arc = std::get_if<ArcPath>(&config.path)) {
    for (const auto* values : {&arc->azimuth_deg, &arc->radius_m, &arc->height_m}) {
      motion.splines_.push_back(OverFrames(*values, frames));
    }
  } else if (const auto* spline = std::get_if<SplinePath>(&config.path)) {
    std::vector<double> knots;
    for (const CameraKey& key : spline->keys) knots.push_back(key.frame);
    for (const auto member : {&CameraKey::position_W, &CameraKey::target_W}) {
      for (int k = 0; k < 3; ++k) {
        std::vector<double> values;
        for (const CameraKey& key : spline->keys) values.push_back((key.*member)[k]);
        motion.splines_.emplace_back(knots, std::move(values));
      }
    }
  } else if (const auto* recorded = std::get_if<RecordedPath>(&config.path)) {
    TSDFPP_ASSIGN(motion.recorded_, Sample(*recorded, frames, rate_hz));
  }
  if (config.jitter) motion.AddJitter(*config.jitter, rate_hz, seed);
  return motion;
}

void CameraMotion::AddJitter(const HandJitter& jitter, double rate_hz, std::uint64_t seed) {
  for (std::uint32_t axis = 0; axis < jitter_.size(); ++axis) {
    const double wanted = axis < 3 ? jitter.position_mm * 1e-3 : jitter.rotation_deg * kRadians;
    double power = 0;
    for (int wave = 0; wave < kJitterWaves; ++wave) {
      const auto draw = UniformDraw(seed, kJitterStream + axis, static_cast<std::uint64_t>(wave));
      // One frequency in each of as many equal parts of the band (on a logarithmic scale).
      const double part = (wave + draw[0]) / kJitterWaves;
      const double hz = jitter.lowest_hz * std::pow(jitter.highest_hz / jitter.lowest_hz, part);
      const double amplitude = 1 / hz;
      power += amplitude * amplitude / 2;
      jitter_[axis].push_back({hz / rate_hz, draw[1], amplitude});
    }
    for (Wave& wave : jitter_[axis]) wave.amplitude *= wanted / std::sqrt(power);
  }
}

Pose CameraMotion::BasePose(double frame) const {
  const auto around = [](const Eigen::Vector3d& target_W, double azimuth_deg, double radius,
                         double height) {
    const double azimuth = azimuth_deg * kRadians;
    return LookAt({target_W.x() + radius * std::cos(azimuth),
                   target_W.y() + radius * std::sin(azimuth), kTableTop_m + height},
                  target_W);
  };
  if (const auto* arc = std::get_if<ArcPath>(&path_)) {
    return around(arc->target_W, splines_[0].Value(frame), splines_[1].Value(frame),
                  splines_[2].Value(frame));
  }
  if (const auto* orbit = std::get_if<OrbitPath>(&path_)) {
    const double part = (frame - kFirstFrame) / std::max(frames_ - 1, 1);
    return around(orbit->target_W, orbit->start_azimuth_deg + 360 * orbit->turns * part,
                  orbit->radius_m, orbit->height_m);
  }
  if (std::holds_alternative<SplinePath>(path_)) {
    return LookAt({splines_[0].Value(frame), splines_[1].Value(frame), splines_[2].Value(frame)},
                  {splines_[3].Value(frame), splines_[4].Value(frame), splines_[5].Value(frame)});
  }
  return PoseAt(recorded_, frame - kFirstFrame);
}

Pose CameraMotion::T_WC(double frame) const {
  Pose T_WC = BasePose(frame);
  if (jitter_.front().empty()) return T_WC;
  std::array<double, 6> sum{};
  for (std::size_t axis = 0; axis < sum.size(); ++axis) {
    for (const Wave& wave : jitter_[axis]) {
      const double turns = wave.cycles_per_frame * (frame - kFirstFrame) + wave.phase;
      sum[axis] += wave.amplitude * std::sin(2 * std::numbers::pi * turns);
    }
  }
  Pose T_CJ = Pose::Identity();
  T_CJ.linear() = FromRotationVector({sum[3], sum[4], sum[5]}).toRotationMatrix();
  T_CJ.translation() = Eigen::Vector3d(sum[0], sum[1], sum[2]);
  return T_WC * T_CJ;
}

}  // namespace tsdfpp
