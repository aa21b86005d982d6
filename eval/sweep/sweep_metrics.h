// The figures that an experiment may ask for: those of evaluations
// (eval/score/evaluation_columns.h) and those of a whole run.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "eval/picture/map_output.h"
#include "eval/score/evaluation.h"
#include "eval/score/evaluation_columns.h"
#include "mapper/map_representation.h"

namespace tsdfpp {

// The time to map a frame, of all mappers alike.
inline constexpr const char* kFrameTimeMetric = "frame_ms";

struct SweepMetric {
  std::string name;   // in CSV, JSON and experiments
  std::string title;  // in tables; empty for those that no table of a comparison has
  std::string words;  // in sentences and on axes, e.g. "hidden table kept"
  std::string unit;   // empty: a share or a ratio, which the report shows in %
  Direction better;
  int decimals;
  std::string definition;       // as docs/metrics.md prints it
  bool can_exceed_one = false;  // of what has no unit
};

// Those of an evaluation first, in the order of EvaluationColumns().
const std::vector<SweepMetric>& SweepMetrics();
// The most that a metric can be; nothing where there is no end. None can be below 0.
std::optional<double> MostOf(const SweepMetric& metric);
// Sums of areas in another order may make a share that is whole a little more than 1.
inline constexpr double kShareRounding = 1e-6;
// nullptr where there is none of this name.
const SweepMetric* FindMetric(std::string_view name);
// The place of the metric of this name, which must be there.
std::size_t MetricIndex(std::string_view name);
// How many of them are an evaluation's, defined at every evaluated frame.
std::size_t EvaluationMetricCount();

// What a mapper took for its work.
struct RunCosts {
  std::optional<RunTimes> times;     // none: not measured step by step
  std::vector<double> frame_s;       // of each frame, all steps together
  std::optional<std::size_t> bytes;  // of the map; none: not known
};

// The values of SweepMetrics(), in their order. `movers` are the objects that were removed.
std::vector<Measured> MeasureAll(const Evaluation& evaluation, const std::set<InstanceId>& movers,
                                 const RunCosts& costs);

// SweepMetrics() as a list of objects: name, title, words, unit, better ("higher" or "lower"),
// decimals, definition. `metric list` prints it, and the report's page reads it.
nlohmann::json MetricsJson();
// The same as a table in Markdown: what docs/metrics.md has.
std::string MetricsMarkdown();

}  // namespace tsdfpp
