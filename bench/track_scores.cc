#include "bench/track_scores.h"

#include <algorithm>
#include <optional>

#include "metrics/object_pose.h"
#include "metrics/statistics.h"
#include "metrics/surface_samples.h"

namespace tsdfpp {
namespace {

Eigen::Vector3d MiddleOf(const std::vector<Eigen::Vector3f>& points) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3f& p : points) sum += p.cast<double>();
  return sum / static_cast<double>(points.size());
}

Trajectory Shown(const Trajectory& poses, const std::set<int>& frames) {
  Trajectory shown;
  for (const auto& [frame, pose] : poses) {
    if (frames.contains(frame)) shown[frame] = pose;
  }
  return shown;
}

// The share of them that are at most a length.
Measured Within(const std::vector<double>& errors_m, double length_m) {
  const auto within =
      std::ranges::count_if(errors_m, [&](double error) { return error <= length_m; });
  return Measured::Of(static_cast<double>(within) / static_cast<double>(errors_m.size()));
}

struct MotionScore {
  double nees = 0;  // a direction that is not free
  int free_directions = 0;
};

// Nothing where the object did not move, nothing of its motion is known, or it was not seen before.
std::optional<MotionScore> ScoreMotion(int frame, const MotionUncertainty& motion,
                                       const Trajectory& estimate, const Trajectory& truth) {
  if (motion.free_directions >= 6) return std::nullopt;
  const auto pose_at = [](const Trajectory& poses, int at) -> std::optional<Pose> {
    const auto found = poses.find(at);
    return found == poses.end() ? std::nullopt : std::optional(found->second);
  };
  const auto estimate_before = pose_at(estimate, motion.since);
  const auto truth_before = pose_at(truth, motion.since);
  const auto estimate_after = pose_at(estimate, frame);
  const auto truth_after = pose_at(truth, frame);
  if (!estimate_before || !truth_before || !estimate_after || !truth_after) return std::nullopt;
  const Pose true_motion = *truth_after * truth_before->inverse();
  const Vector6 way = motion.frame_W.LengthsOf(true_motion);
  if (way.head<3>().norm() + way.tail<3>().norm() < kLeastMotion_m) return std::nullopt;
  const Pose found_motion = *estimate_after * estimate_before->inverse();
  const Vector6 error = motion.frame_W.LengthsOf(found_motion * true_motion.inverse());
  const double squares = error.dot(motion.covariance_m2.ldlt().solve(error));
  return MotionScore{squares / (6 - motion.free_directions), motion.free_directions};
}

}  // namespace

TrackScores ScoreTracked(const TrackedObject& object) {
  const Trajectory estimate = Shown(object.T_WO_estimate, object.shown);
  const Trajectory truth = Shown(object.T_WO_truth, object.shown);
  const PosePairs pairs = AnchoredAtFirst(PairByFrame(estimate, truth));
  const Eigen::Vector3d middle_O = MiddleOf(object.points_O);
  TrackScores scores;
  scores.frames = pairs.size();
  // Both poses of the middle, so that a turn about it is no shift.
  const Pose C = Eigen::Translation3d(middle_O) * Pose::Identity();
  Trajectory of_estimate;
  Trajectory of_truth;
  std::vector<double> add_m;
  std::vector<double> add_s_m;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    of_estimate[pairs.frames[i]] = pairs.estimate[i] * C;
    of_truth[pairs.frames[i]] = pairs.truth[i] * C;
    scores.end_m = (pairs.estimate[i] * middle_O - pairs.truth[i] * middle_O).norm();
    scores.farthest_m = std::max(scores.farthest_m, scores.end_m);
    for (const Eigen::Vector3f& p_O : object.points_O) {
      const Eigen::Vector3d p = p_O.cast<double>();
      scores.moved_m = std::max(scores.moved_m, (pairs.truth[i] * p - pairs.truth[0] * p).norm());
    }
    add_m.push_back(*AddError_m(object.points_O, pairs.estimate[i], pairs.truth[i]).value);
    add_s_m.push_back(
        *AddSymmetricError_m(object.points_O, pairs.estimate[i], pairs.truth[i]).value);
  }
  scores.trajectory =
      ScoreObjectTrajectory(of_estimate, of_truth, Pose::Identity(), Pose::Identity());
  scores.add_m = Measured::Of(MeanOf(add_m));
  scores.add_s_m = Measured::Of(MeanOf(add_s_m));
  scores.within_5mm = Within(add_s_m, 0.005);
  scores.within_2cm = Within(add_s_m, 0.02);
  std::vector<double> nees;
  std::vector<double> free_directions;
  for (const auto& [frame, motion] : object.motions) {
    const auto score = ScoreMotion(frame, motion, estimate, truth);
    if (!score) continue;
    nees.push_back(score->nees);
    free_directions.push_back(score->free_directions);
  }
  if (!nees.empty()) {
    scores.nees = Measured::Of(MeanOf(nees));
    scores.free_directions = MeanOf(free_directions);
  }
  return scores;
}

std::vector<Eigen::Vector3f> SomePoints(const TriangleMesh& mesh) {
  constexpr std::size_t kPoints = 500;
  const SampleConfig config;
  const SampleSet samples = SampleMesh(mesh, config.fine_per_cm2, config.seed);
  std::vector<Eigen::Vector3f> points;
  const std::size_t count = std::min(kPoints, samples.size());
  for (std::size_t i = 0; i < count; ++i) {
    points.push_back(samples.points[i * samples.size() / count]);
  }
  return points;
}

}  // namespace tsdfpp
