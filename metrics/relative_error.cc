#include "metrics/relative_error.h"

#include <algorithm>
#include <cmath>

namespace tsdfpp {
namespace {

// Median of the differences between neighbours; 0 for fewer than two stamps.
double MedianInterval_s(const StampedTrajectory& trajectory) {
  std::vector<double> intervals;
  double last_s = 0;
  for (const auto& [stamp_s, pose] : trajectory) {
    if (stamp_s != trajectory.begin()->first) intervals.push_back(stamp_s - last_s);
    last_s = stamp_s;
  }
  const auto summary = SummariseErrors(intervals);
  return summary ? summary->median : 0;
}

}  // namespace

RelativeErrors RelativePoseErrors(const PosePairs& pairs, const std::vector<Stretch>& stretches) {
  RelativeErrors errors;
  for (const Stretch& stretch : stretches) {
    const Pose truth = pairs.truth[stretch.from].inverse() * pairs.truth[stretch.to];
    const Pose estimate = pairs.estimate[stretch.from].inverse() * pairs.estimate[stretch.to];
    const Pose error = truth.inverse() * estimate;
    errors.translation_m.push_back(error.translation().norm());
    errors.rotation_rad.push_back(RotationAngle_rad(error.linear()));
  }
  return errors;
}

std::vector<Stretch> StretchesByFrames(std::size_t pairs, std::size_t delta, bool overlapping) {
  std::vector<Stretch> stretches;
  if (delta == 0) return stretches;
  const std::size_t step = overlapping ? 1 : delta;
  for (std::size_t i = 0; i + delta < pairs; i += step) stretches.push_back({i, i + delta});
  return stretches;
}

std::vector<Stretch> StretchesByPath(const PosePairs& pairs, double delta_m) {
  std::vector<std::size_t> cuts;
  double gone_m = 0;
  for (std::size_t i = 1; i < pairs.size(); ++i) {
    gone_m += (pairs.estimate[i].translation() - pairs.estimate[i - 1].translation()).norm();
    if (gone_m < delta_m) continue;
    cuts.push_back(i);
    gone_m = 0;
  }
  std::vector<Stretch> stretches;
  for (std::size_t k = 1; k < cuts.size(); ++k) stretches.push_back({cuts[k - 1], cuts[k]});
  return stretches;
}

RelativeErrors RelativePoseErrors(const PosePairs& pairs, std::size_t delta, bool overlapping) {
  return RelativePoseErrors(pairs, StretchesByFrames(pairs.size(), delta, overlapping));
}

RelativeErrors TumRelativePoseErrors(const StampedTrajectory& truth,
                                     const StampedTrajectory& estimate, double delta,
                                     DeltaUnit unit) {
  if (truth.empty() || estimate.empty()) return {};
  std::vector<double> stamps_s;
  std::vector<double> position;  // of each pose, in the delta's unit
  StampedTrajectory by_position;
  for (const auto& [stamp_s, pose] : estimate) {
    position.push_back(unit == DeltaUnit::kSeconds ? stamp_s
                                                   : static_cast<double>(stamps_s.size()));
    by_position.emplace(position.back(), pose);
    stamps_s.push_back(stamp_s);
  }
  const double farthest_s = 2 * MedianInterval_s(truth);
  PosePairs pairs;
  std::vector<Stretch> backwards;
  for (std::size_t i = 0; i < stamps_s.size(); ++i) {
    const auto end = NearestInTime(by_position, position[i] + delta);
    const auto j = static_cast<std::size_t>(
        std::lower_bound(position.begin(), position.end(), end->first) - position.begin());
    if (j + 1 == stamps_s.size()) continue;
    const auto truth_i = NearestInTime(truth, stamps_s[i]);
    const auto truth_j = NearestInTime(truth, stamps_s[j]);
    if (std::abs(truth_i->first - stamps_s[i]) > farthest_s ||
        std::abs(truth_j->first - stamps_s[j]) > farthest_s) {
      continue;
    }
    backwards.push_back({pairs.estimate.size() + 1, pairs.estimate.size()});
    pairs.estimate.push_back(estimate.at(stamps_s[i]));
    pairs.estimate.push_back(end->second);
    pairs.truth.push_back(truth_i->second);
    pairs.truth.push_back(truth_j->second);
  }
  return RelativePoseErrors(pairs, backwards);
}

}  // namespace tsdfpp
