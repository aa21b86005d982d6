#include "metrics/trajectory_report.h"

#include <fmt/format.h>

#include "core/units.h"

namespace tsdfpp {
namespace {

MeasuredSummary Summarise(std::vector<double> errors, double unit, const std::string& why_empty) {
  for (double& error : errors) error *= unit;
  const auto summary = SummariseErrors(errors);
  return summary ? MeasuredSummary{summary, {}} : MeasuredSummary{std::nullopt, why_empty};
}

double Length_m(const std::vector<Pose>& poses) {
  double length_m = 0;
  for (std::size_t i = 1; i < poses.size(); ++i) {
    length_m += (poses[i].translation() - poses[i - 1].translation()).norm();
  }
  return length_m;
}

RelativeReport Relative(const RelativeDelta& delta, const PosePairs& pairs,
                        const StampedTrajectory& truth, const StampedTrajectory& scaled) {
  RelativeErrors errors;
  const char* unit = "";
  switch (delta.unit) {
    case RelativeDelta::Unit::kFrames:
      errors = RelativePoseErrors(pairs, static_cast<std::size_t>(delta.amount), delta.overlapping);
      unit = "frames";
      break;
    case RelativeDelta::Unit::kMetres:
      errors = RelativePoseErrors(pairs, StretchesByPath(pairs, delta.amount));
      unit = "m of way";
      break;
    case RelativeDelta::Unit::kSeconds:
      errors = TumRelativePoseErrors(truth, scaled, delta.amount, DeltaUnit::kSeconds);
      unit = "s";
      break;
  }
  const std::string why =
      fmt::format("no stretch of {} {} in {} pairs of poses", delta.amount, unit, pairs.size());
  return {delta, errors.translation_m.size(), Summarise(errors.translation_m, 1, why),
          Summarise(errors.rotation_rad, kDegPerRad, why)};
}

}  // namespace

TrajectoryReport ReportTrajectory(const StampedTrajectory& truth, const StampedTrajectory& estimate,
                                  const TrajectoryOptions& options) {
  const Association association = AssociateByTime(truth, estimate, options.max_difference_s);
  TrajectoryReport report;
  report.pairs = association.pairs.size();
  report.unmatched_estimate = association.unmatched_estimate;
  report.unmatched_truth = association.unmatched_truth;
  report.truth_length_m = Length_m(association.pairs.truth);
  report.estimate_length_m = Length_m(association.pairs.estimate);

  PosePairs pairs = association.pairs;
  std::string why =
      fmt::format("no pose of the estimate is within {} s of a true one", options.max_difference_s);
  std::string why_no_rotation = why;
  StampedTrajectory scaled = estimate;
  if (options.align != AlignmentKind::kNone) {
    report.alignment = AlignHorn(pairs, options.align == AlignmentKind::kSim3);
    if (report.alignment) {
      pairs = Aligned(pairs, *report.alignment);
      for (auto& [stamp_s, pose] : scaled) pose.translation() *= report.alignment->scale;
    } else if (pairs.size() > 0) {
      why = pairs.size() < 3
                ? fmt::format("an alignment needs 3 pairs of poses, found {}", pairs.size())
                : std::string("no alignment is best: all poses are at one point");
      why_no_rotation = why;
    }
    if (report.alignment && !report.alignment->rotation_is_unique) {
      why_no_rotation = "the poses lie on one line, so an alignment's turn about it is anything";
    }
  }
  const bool aligned = options.align == AlignmentKind::kNone || report.alignment;
  const bool turned = aligned && (!report.alignment || report.alignment->rotation_is_unique);
  const PosePairs none;
  report.translation_m = Summarise(TranslationErrors_m(aligned ? pairs : none), 1, why);
  report.rotation_deg =
      Summarise(RotationErrors_rad(turned ? pairs : none), kDegPerRad, why_no_rotation);
  report.full = Summarise(FullErrors(turned ? pairs : none), 1, why_no_rotation);
  for (const RelativeDelta& delta : options.deltas) {
    report.relative.push_back(Relative(delta, pairs, truth, scaled));
  }
  return report;
}

}  // namespace tsdfpp
