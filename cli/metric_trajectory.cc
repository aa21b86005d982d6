#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <charconv>

#include "cli/metric.h"
#include "metrics/trajectory_report.h"
#include "sequence/timed_poses.h"

namespace tsdfpp {
namespace {

struct MetricTrajectoryArguments {
  std::string truth;
  std::string estimate;
  std::string align = "none";
  std::string deltas = "1f";
  bool all_pairs = false;
  double max_difference_s = kMaxStampDifference_s;
};

const std::map<std::string, AlignmentKind> kAlignments = {
    {"none", AlignmentKind::kNone}, {"se3", AlignmentKind::kSe3}, {"sim3", AlignmentKind::kSim3}};

// "10f", "0.1m", "1s".
Expected<RelativeDelta> DeltaFromText(const std::string& word, bool overlapping) {
  RelativeDelta delta;
  const auto [end, status] = std::from_chars(word.data(), word.data() + word.size(), delta.amount);
  const std::string unit(end, word.data() + word.size());
  const bool known = unit == "f" || unit == "m" || unit == "s";
  const bool whole = delta.amount == std::floor(delta.amount) && delta.amount <= 1e9;
  if (status != std::errc() || !known || !(delta.amount > 0) || !std::isfinite(delta.amount) ||
      (unit == "f" && !whole)) {
    return UsageError(
        "--delta '{}': expected a number above 0 and its unit: frames, a whole number (10f), "
        "metres of way (0.1m), or seconds (1s)",
        word);
  }
  delta.unit = unit == "f"   ? RelativeDelta::Unit::kFrames
               : unit == "m" ? RelativeDelta::Unit::kMetres
                             : RelativeDelta::Unit::kSeconds;
  delta.overlapping = overlapping && unit == "f";
  return delta;
}

nlohmann::json ToJson(const MeasuredSummary& summary) {
  if (!summary.value) return {{"value", nullptr}, {"why", summary.why_not}};
  const ErrorSummary& s = *summary.value;
  return {
      {"rmse", s.rmse},    {"mean", s.mean},   {"median", s.median},  {"std", s.standard_deviation},
      {"min", s.smallest}, {"max", s.largest}, {"sse", s.squares_sum}};
}

std::string Row(const std::string& title, const MeasuredSummary& summary) {
  if (!summary.value) return fmt::format("{:<26} undefined: {}\n", title, summary.why_not);
  const ErrorSummary& s = *summary.value;
  return fmt::format("{:<26} {:>10.6f} {:>10.6f} {:>10.6f} {:>10.6f} {:>10.6f} {:>10.6f}\n", title,
                     s.rmse, s.mean, s.median, s.standard_deviation, s.smallest, s.largest);
}

nlohmann::json AlignmentJson(const Alignment& alignment) {
  nlohmann::json rows = nlohmann::json::array();
  for (Eigen::Index r = 0; r < 3; ++r) {
    rows.push_back({alignment.R(r, 0), alignment.R(r, 1), alignment.R(r, 2)});
  }
  return {{"R", rows},
          {"t", {alignment.t.x(), alignment.t.y(), alignment.t.z()}},
          {"scale", alignment.scale},
          {"rotation_is_unique", alignment.rotation_is_unique}};
}

Expected<TrajectoryOptions> MeasureOf(const MetricTrajectoryArguments& options) {
  TrajectoryOptions measure;
  measure.align = kAlignments.at(options.align);
  measure.max_difference_s = options.max_difference_s;
  measure.deltas.clear();
  const std::vector<std::string> words = SplitList(options.deltas);
  if (words.empty()) return UsageError("--delta is empty, expected e.g. 1f,10f,0.1m,1s");
  for (const std::string& word : words) {
    TSDFPP_ASSIGN(const RelativeDelta delta, DeltaFromText(word, options.all_pairs));
    measure.deltas.push_back(delta);
  }
  const bool any_overlap =
      std::any_of(measure.deltas.begin(), measure.deltas.end(),
                  [](const RelativeDelta& delta) { return delta.overlapping; });
  if (options.all_pairs && !any_overlap) {
    return UsageError(
        "--all-pairs: --delta '{}' has no stretch of frames, expected one at least, as in 10f",
        options.deltas);
  }
  return measure;
}

nlohmann::json ReportJson(const TrajectoryReport& report,
                          const MetricTrajectoryArguments& options) {
  nlohmann::json json = {
      {"reference", options.truth},
      {"estimate", options.estimate},
      {"align", options.align},
      {"max_difference_s", options.max_difference_s},
      {"pairs", report.pairs},
      {"unmatched_estimate", report.unmatched_estimate},
      {"unmatched_reference", report.unmatched_truth},
      {"reference_length_m", report.truth_length_m},
      {"estimate_length_m", report.estimate_length_m},
      {"alignment", report.alignment ? AlignmentJson(*report.alignment) : nlohmann::json()},
      {"ape",
       {{"translation_m", ToJson(report.translation_m)},
        {"rotation_deg", ToJson(report.rotation_deg)},
        {"full", ToJson(report.full)}}},
      {"rpe", nlohmann::json::array()}};
  const std::vector<std::string> words = SplitList(options.deltas);
  for (std::size_t k = 0; k < report.relative.size(); ++k) {
    const RelativeReport& relative = report.relative[k];
    const char* rule = relative.delta.unit == RelativeDelta::Unit::kSeconds ? "tum" : "evo";
    json["rpe"].push_back({{"delta", words[k]},
                           {"all_pairs", relative.delta.overlapping},
                           {"rule", rule},
                           {"stretches", relative.stretches},
                           {"translation_m", ToJson(relative.translation_m)},
                           {"rotation_deg", ToJson(relative.rotation_deg)}});
  }
  return json;
}

std::string ReportText(const TrajectoryReport& report, const MetricTrajectoryArguments& options) {
  std::string text = fmt::format(
      "{} pairs of poses; without a partner: {} of the estimate, {} of the reference\n"
      "way of the reference {:.3f} m, of the estimate {:.3f} m; alignment {}\n",
      report.pairs, report.unmatched_estimate, report.unmatched_truth, report.truth_length_m,
      report.estimate_length_m, options.align);
  if (report.alignment) text += fmt::format("scale {:.6f}\n", report.alignment->scale);
  text += fmt::format("{:<26} {:>10} {:>10} {:>10} {:>10} {:>10} {:>10}\n", "", "rmse", "mean",
                      "median", "std", "min", "max");
  text += Row("APE translation, m", report.translation_m);
  text += Row("APE rotation, deg", report.rotation_deg);
  const std::vector<std::string> words = SplitList(options.deltas);
  for (std::size_t k = 0; k < report.relative.size(); ++k) {
    const RelativeReport& relative = report.relative[k];
    text += Row(fmt::format("RPE {} translation, m", words[k]), relative.translation_m);
    text += Row(fmt::format("RPE {} rotation, deg", words[k]), relative.rotation_deg);
  }
  return text;
}

Expected<CommandResult> RunTrajectory(const MetricTrajectoryArguments& options) {
  TSDFPP_ASSIGN(const TrajectoryOptions measure, MeasureOf(options));
  std::vector<std::string> remarks;
  TSDFPP_ASSIGN(const TimedPoses truth, ReadTimedPoses(options.truth, &remarks));
  TSDFPP_ASSIGN(const TimedPoses estimate, ReadTimedPoses(options.estimate, &remarks));
  const TrajectoryReport report = ReportTrajectory(truth, estimate, measure);
  if (report.pairs == 0) {
    return DataError(
        "{}: none of its {} poses ({:.3f} to {:.3f} s) is within {} s of one of {} ({:.3f} to "
        "{:.3f} s): is it another clock?",
        options.estimate, estimate.size(), estimate.begin()->first, estimate.rbegin()->first,
        options.max_difference_s, options.truth, truth.begin()->first, truth.rbegin()->first);
  }
  nlohmann::json json = ReportJson(report, options);
  json["remarks"] = remarks;
  for (const std::string& remark : remarks) spdlog::warn("{}", remark);
  return CommandResult{json, ReportText(report, options)};
}

}  // namespace

Run AddMetricTrajectory(CLI::App& app) {
  auto options = std::make_shared<MetricTrajectoryArguments>();
  app.add_option("REF", options->truth, "True trajectory: lines t tx ty tz qx qy qz qw")
      ->required();
  app.add_option("EST", options->estimate, "Estimated trajectory, the same")->required();
  app.add_option("--align", options->align,
                 "Before APE, fit the estimate to the truth: none, se3 (turn, move), sim3 (scale)")
      ->check(OneOf({"none", "se3", "sim3"}))
      ->capture_default_str();
  app.add_option("--delta", options->deltas,
                 "Stretches of RPE, by commas: frames 10f, metres 0.1m, seconds 1s (TUM's rule)")
      ->capture_default_str();
  app.add_flag("--all-pairs", options->all_pairs,
               "Stretches of frames from every pose, overlapping");
  app.add_option("--max-diff", options->max_difference_s,
                 "Most seconds between the stamps of a pair")
      ->check(NotNegative())
      ->capture_default_str();
  return [options] { return RunTrajectory(*options); };
}

}  // namespace tsdfpp
