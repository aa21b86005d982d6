#include "bench/track_scores.h"

#include <algorithm>

#include "metrics/object_pose.h"

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

// Their mean, and the share of those that are at most a length.
struct Errors {
  std::vector<double> errors_m;

  Measured Mean() const {
    double sum = 0;
    for (const double error : errors_m) sum += error;
    return Measured::Of(sum / static_cast<double>(errors_m.size()));
  }
  double Within(double length_m) const {
    const auto within =
        std::ranges::count_if(errors_m, [&](double error) { return error <= length_m; });
    return static_cast<double>(within) / static_cast<double>(errors_m.size());
  }
};

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
  Errors add;
  Errors add_s;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    of_estimate[pairs.frames[i]] = pairs.estimate[i] * C;
    of_truth[pairs.frames[i]] = pairs.truth[i] * C;
    scores.end_m = (pairs.estimate[i] * middle_O - pairs.truth[i] * middle_O).norm();
    scores.farthest_m = std::max(scores.farthest_m, scores.end_m);
    scores.moved_m =
        std::max(scores.moved_m, (pairs.truth[i] * middle_O - pairs.truth[0] * middle_O).norm());
    add.errors_m.push_back(*AddError_m(object.points_O, pairs.estimate[i], pairs.truth[i]).value);
    add_s.errors_m.push_back(
        *AddSymmetricError_m(object.points_O, pairs.estimate[i], pairs.truth[i]).value);
  }
  scores.trajectory =
      ScoreObjectTrajectory(of_estimate, of_truth, Pose::Identity(), Pose::Identity());
  scores.add_m = add.Mean();
  scores.add_s_m = add_s.Mean();
  scores.within_5mm = Measured::Of(add_s.Within(0.005));
  scores.within_2cm = Measured::Of(add_s.Within(0.02));
  return scores;
}

}  // namespace tsdfpp
