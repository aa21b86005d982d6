#include "metrics/association.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <set>

namespace tsdfpp {

StampedTrajectory::const_iterator NearestInTime(const StampedTrajectory& trajectory,
                                                double stamp_s) {
  const auto after = trajectory.lower_bound(stamp_s);
  if (after == trajectory.begin()) return after;
  const auto before = std::prev(after);
  if (after == trajectory.end()) return before;
  return stamp_s - before->first <= after->first - stamp_s ? before : after;
}

Association AssociateByTime(const StampedTrajectory& truth, const StampedTrajectory& estimate,
                            double max_difference_s) {
  Association out;
  out.unmatched_estimate = estimate.size();
  out.unmatched_truth = truth.size();
  if (truth.empty() || estimate.empty()) return out;
  const bool truth_is_shorter = truth.size() < estimate.size();
  const StampedTrajectory& shorter = truth_is_shorter ? truth : estimate;
  const StampedTrajectory& longer = truth_is_shorter ? estimate : truth;
  std::vector<double> estimate_stamps;
  for (const auto& [stamp_s, pose] : estimate) estimate_stamps.push_back(stamp_s);
  std::set<double> used;  // of the longer
  for (const auto& [stamp_s, pose] : shorter) {
    const auto partner = NearestInTime(longer, stamp_s);
    if (std::abs(partner->first - stamp_s) > max_difference_s) continue;
    used.insert(partner->first);
    const Pose& of_estimate = truth_is_shorter ? partner->second : pose;
    const double estimate_s = truth_is_shorter ? partner->first : stamp_s;
    out.pairs.frames.push_back(static_cast<int>(
        std::lower_bound(estimate_stamps.begin(), estimate_stamps.end(), estimate_s) -
        estimate_stamps.begin()));
    out.pairs.estimate.push_back(of_estimate);
    out.pairs.truth.push_back(truth_is_shorter ? pose : partner->second);
    out.stamps_s.push_back(estimate_s);
  }
  (truth_is_shorter ? out.unmatched_truth : out.unmatched_estimate) -= out.pairs.size();
  (truth_is_shorter ? out.unmatched_estimate : out.unmatched_truth) -= used.size();
  return out;
}

}  // namespace tsdfpp
