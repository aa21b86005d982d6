#include "metrics/preservation.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/units.h"

namespace tsdfpp {
namespace {

template <typename Keep>
Selection Narrow(const Selection& within, const Keep& keep) {
  Selection out(within.size(), 0);
  for (std::size_t i = 0; i < within.size(); ++i) out[i] = within[i] != 0 && keep(i) ? 1 : 0;
  return out;
}

}  // namespace

Selection SelectAll(const SampleSet& samples) { return Selection(samples.size(), 1); }

Selection SelectRegion(const SampleSet& samples, std::uint16_t region) {
  return Narrow(SelectAll(samples), [&](std::size_t i) { return samples.region[i] == region; });
}

Selection SelectSeen(const SeenTracker& tracker, const Selection& within) {
  return Narrow(within, [&](std::size_t i) { return tracker.Seen(i); });
}

Selection SelectSeenWith(const SeenTracker& tracker, SampleStatus status, const Selection& within) {
  return Narrow(within,
                [&](std::size_t i) { return tracker.Seen(i) && tracker.status()[i] == status; });
}

Selection SelectHidden(const SeenTracker& tracker, const Selection& within) {
  return Narrow(within, [&](std::size_t i) {
    const SampleStatus status = tracker.status()[i];
    return tracker.Seen(i) && status != SampleStatus::kVisible &&
           status != SampleStatus::kUnmeasured;
  });
}

SampleMatch MatchSamples(const SampleSet& samples_O, const Selection& selected, const Pose& T_WO,
                         const SurfaceIndex& surface_W, double limit_m, double max_angle_rad) {
  std::vector<Eigen::Vector3f> points;
  std::vector<Eigen::Vector3f> normals;
  for (std::size_t i = 0; i < samples_O.size(); ++i) {
    if (selected[i] == 0) continue;
    points.push_back(samples_O.points[i]);
    normals.push_back(samples_O.normals[i]);
  }
  const SampleMatch compact =
      MatchSurface(TransformPoints(T_WO, points), TransformNormals(T_WO, normals), surface_W,
                   limit_m, max_angle_rad);
  SampleMatch match;
  match.nearest_m.assign(samples_O.size(), std::numeric_limits<float>::infinity());
  match.agreeing_m = match.nearest_m;
  for (std::size_t i = 0, k = 0; i < samples_O.size(); ++i) {
    if (selected[i] == 0) continue;
    match.nearest_m[i] = compact.nearest_m[k];
    match.agreeing_m[i] = compact.agreeing_m[k];
    ++k;
  }
  return match;
}

Selection Reconstructed(const SampleMatch& match, double tau_m) {
  Selection out(match.agreeing_m.size(), 0);
  for (std::size_t i = 0; i < out.size(); ++i) {
    out[i] = static_cast<double>(match.agreeing_m[i]) <= tau_m ? 1 : 0;
  }
  return out;
}

double SelectedArea_m2(const SampleSet& samples, const Selection& selected) {
  double area = 0;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    if (selected[i] != 0) area += static_cast<double>(samples.area_m2[i]);
  }
  return area;
}

Measured ShareOf(const SampleSet& samples, const Selection& selected, const Selection& those,
                 const std::string& why_empty) {
  const double all = SelectedArea_m2(samples, selected);
  if (!(all > 0)) return Measured::Undefined(why_empty);
  const auto both = Narrow(selected, [&](std::size_t i) { return those[i] != 0; });
  return Measured::Of(SelectedArea_m2(samples, both) / all);
}

DistanceSummary SummariseDistances(std::span<const float> distances_m,
                                   std::span<const float> weights, const std::string& why_empty) {
  double total = 0;
  double sum = 0;
  double squares = 0;
  for (std::size_t i = 0; i < distances_m.size(); ++i) {
    const double distance = distances_m[i];
    const double weight = weights[i];
    total += weight;
    sum += weight * distance;
    squares += weight * distance * distance;
  }
  if (!(total > 0)) {
    const Measured undefined = Measured::Undefined(why_empty);
    return {undefined, undefined, undefined};
  }
  std::vector<std::size_t> order(distances_m.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return distances_m[a] < distances_m[b]; });
  double walked = 0;
  double p95 = 0;
  for (const std::size_t i : order) {
    walked += static_cast<double>(weights[i]);
    p95 = distances_m[i];
    if (walked >= 0.95 * total) break;
  }
  return {Measured::Of(sum / total), Measured::Of(std::sqrt(squares / total)), Measured::Of(p95)};
}

DistanceSummary CompletionDistances(const SampleSet& samples, const Selection& selected,
                                    const SampleMatch& match) {
  std::vector<float> distances;
  std::vector<float> weights;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    if (selected[i] == 0) continue;
    if (!std::isfinite(match.nearest_m[i])) {
      return SummariseDistances({}, {}, "the reconstruction is empty");
    }
    distances.push_back(match.nearest_m[i]);
    weights.push_back(samples.area_m2[i]);
  }
  return SummariseDistances(distances, weights, "no sample was seen");
}

Measured FScore(const Measured& precision, const Measured& recall) {
  if (!precision.value) return precision;
  if (!recall.value) return recall;
  const double sum = *precision.value + *recall.value;
  return Measured::Of(sum > 0 ? 2 * *precision.value * *recall.value / sum : 0);
}

void LastSeenStore::Update(const Selection& reconstructed, const Selection& visible_now) {
  for (std::size_t i = 0; i < state_.size(); ++i) {
    if (visible_now[i] != 0) state_[i] = reconstructed[i] != 0 ? kPresent : kMissing;
  }
}

Measured LastSeenStore::Retention(const SampleSet& samples, const Selection& hidden,
                                  const Selection& reconstructed_now) const {
  const Selection known = Narrow(hidden, [&](std::size_t i) { return state_[i] != kNeverSeen; });
  const Selection before = Narrow(known, [&](std::size_t i) { return state_[i] == kPresent; });
  const Selection now = Narrow(known, [&](std::size_t i) { return reconstructed_now[i] != 0; });
  const double before_m2 = SelectedArea_m2(samples, before);
  if (!(SelectedArea_m2(samples, known) > 0)) {
    return Measured::Undefined("no hidden sample was visible at an evaluated frame");
  }
  if (!(before_m2 > 0)) {
    return Measured::Undefined("no hidden sample was reconstructed when last seen");
  }
  return Measured::Of(SelectedArea_m2(samples, now) / before_m2);
}

PreservationScores ScorePreservation(const SeenTracker& tracker, const Selection& within,
                                     const Selection& reconstructed, const LastSeenStore& last_seen,
                                     const Selection* any_label) {
  const SampleSet& samples = tracker.samples_O();
  const Selection seen = SelectSeen(tracker, within);
  const Selection visible = SelectSeenWith(tracker, SampleStatus::kVisible, within);
  const Selection hidden = SelectHidden(tracker, within);
  const auto share = [&](const Selection& of, const std::string& why) {
    return ShareOf(samples, of, reconstructed, why);
  };

  PreservationScores scores;
  scores.completion = share(seen, "no sample was seen");
  scores.visible_completion = share(visible, "no sample is visible now");
  scores.preservation = share(hidden, "no seen sample is hidden now");
  scores.retention = last_seen.Retention(samples, hidden, reconstructed);
  scores.seen_area_cm2 = kCm2PerM2 * SelectedArea_m2(samples, seen);
  scores.visible_area_cm2 = kCm2PerM2 * SelectedArea_m2(samples, visible);
  scores.hidden_area_cm2 = kCm2PerM2 * SelectedArea_m2(samples, hidden);

  constexpr std::array kWhyNone{"no seen sample is behind another object now",
                                "no seen sample is behind its own object now",
                                "no seen sample is outside the image now"};
  for (std::size_t k = 0; k < kHidingCauses.size(); ++k) {
    const Selection by_cause = SelectSeenWith(tracker, kHidingCauses[k], within);
    HiddenScores& of_cause = scores.by_cause[k];
    of_cause.area_cm2 = kCm2PerM2 * SelectedArea_m2(samples, by_cause);
    of_cause.preservation = share(by_cause, kWhyNone[k]);
    of_cause.retention = last_seen.Retention(samples, by_cause, reconstructed);
    of_cause.lost_area_cm2 =
        of_cause.preservation.value
            ? Measured::Of((1 - *of_cause.preservation.value) * of_cause.area_cm2)
            : of_cause.preservation;
    of_cause.any_label = any_label != nullptr
                             ? ShareOf(samples, by_cause, *any_label, kWhyNone[k])
                             : Measured::Undefined("not asked without regard to labels");
  }
  scores.preservation_behind_other = scores.by_cause[0].preservation;
  scores.preservation_behind_itself = scores.by_cause[1].preservation;
  scores.preservation_outside = scores.by_cause[2].preservation;
  scores.retention_behind_other = scores.by_cause[0].retention;
  scores.hole_area_cm2 = scores.by_cause[0].lost_area_cm2;
  scores.behind_other_area_cm2 = scores.by_cause[0].area_cm2;
  return scores;
}

}  // namespace tsdfpp
