#include "bench/track_scores.h"

#include <algorithm>

#include "metrics/object_pose.h"
#include "metrics/statistics.h"

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
  return scores;
}

}  // namespace tsdfpp
