// Relative pose errors: how far an estimate drifts over a stretch of the way.
#pragma once

#include <cstddef>
#include <vector>

#include "metrics/association.h"
#include "metrics/trajectory.h"

namespace tsdfpp {

// Indices of two pairs, the start and the end of a stretch.
struct Stretch {
  std::size_t from = 0;
  std::size_t to = 0;
};

struct RelativeErrors {
  std::vector<double> translation_m;
  std::vector<double> rotation_rad;
};

// A stretch each: E = (Q_i^-1 Q_j)^-1 (P_i^-1 P_j), Q the truth; the length of E's translation and
// the angle of its rotation (Sturm et al. 2012, eq. 2).
RelativeErrors RelativePoseErrors(const PosePairs& pairs, const std::vector<Stretch>& stretches);

// Stretches of `delta` pairs; none where that is 0. `overlapping`: from every pair, otherwise one
// after the other: 0, delta, 2 delta ... (evo's delta_unit frames, with and without all_pairs).
std::vector<Stretch> StretchesByFrames(std::size_t pairs, std::size_t delta,
                                       bool overlapping = false);

// Stretches of the estimate's way of `delta_m` metres, one after the other, as evo cuts them: a cut
// lies at the first pose by which at least `delta_m` were gone since the cut before, and the first
// stretch begins at the first cut. So a stretch is as much longer than `delta_m` as a step is.
std::vector<Stretch> StretchesByPath(const PosePairs& pairs, double delta_m);

// RelativePoseErrors over StretchesByFrames.
RelativeErrors RelativePoseErrors(const PosePairs& pairs, std::size_t delta,
                                  bool overlapping = false);

enum class DeltaUnit { kFrames, kSeconds };

// As TUM's evaluate_rpe.py --fixed_delta does, which knows no pairs: from every pose of the
// estimate to the one nearest to `delta` later (frames or seconds), if that is not the last; the
// true poses are the nearest in time, at most twice the truth's median interval away. Its error is
// taken backwards, from j to i, which leaves the angle as it is but not the translation.
RelativeErrors TumRelativePoseErrors(const StampedTrajectory& truth,
                                     const StampedTrajectory& estimate, double delta,
                                     DeltaUnit unit);

}  // namespace tsdfpp
