// Everything that two trajectories say of each other: what `tsdfpp metric trajectory` prints.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "metrics/association.h"
#include "metrics/relative_error.h"
#include "metrics/trajectory.h"

namespace tsdfpp {

// A summary that may be undefined, as Measured is for one number.
struct MeasuredSummary {
  std::optional<ErrorSummary> value;
  std::string why_not;
};

enum class AlignmentKind {
  kNone,  // both are in one world, as a mapper's camera must be
  kSe3,   // turned and moved
  kSim3,  // scaled too: for monocular systems
};

// How long a stretch of RPE is.
struct RelativeDelta {
  enum class Unit { kFrames, kMetres, kSeconds };
  double amount = 1;  // of kFrames a whole number from 1
  Unit unit = Unit::kFrames;
  bool overlapping = false;  // of kFrames: from every pair (evo's all_pairs)
};

struct TrajectoryOptions {
  AlignmentKind align = AlignmentKind::kNone;
  double max_difference_s = kMaxStampDifference_s;
  std::vector<RelativeDelta> deltas = {{}};
};

struct RelativeReport {
  RelativeDelta delta;
  std::size_t stretches = 0;
  MeasuredSummary translation_m;
  MeasuredSummary rotation_deg;
};

struct TrajectoryReport {
  std::size_t pairs = 0;
  std::size_t unmatched_estimate = 0;
  std::size_t unmatched_truth = 0;
  double truth_length_m = 0;     // of the way over the paired poses
  double estimate_length_m = 0;  // the same, before any alignment
  std::optional<Alignment> alignment;
  MeasuredSummary translation_m;  // APE; its rmse is what is known as ATE
  MeasuredSummary rotation_deg;
  MeasuredSummary full;  // FullErrors(), no unit
  std::vector<RelativeReport> relative;
};

// Associates, aligns and measures. APE needs a pair, an alignment three that are not on one point;
// rotations after an alignment are undefined where the poses lie on one line. RPE is over the
// aligned pairs: StretchesByFrames, StretchesByPath, and for seconds TUM's rule (which takes the
// estimate as it is, but for the scale).
TrajectoryReport ReportTrajectory(const StampedTrajectory& truth, const StampedTrajectory& estimate,
                                  const TrajectoryOptions& options);

}  // namespace tsdfpp
