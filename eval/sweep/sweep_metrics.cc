#include "eval/sweep/sweep_metrics.h"

#include <fmt/format.h>

#include <cstdlib>
#include <functional>

#include "metrics/statistics.h"

namespace tsdfpp {
namespace {

// Root mean square distance of the reconstruction to the truth, mean over the moving objects that
// have one. Without labels that would be whatever lies nearest to them, the table perhaps.
Measured MoversAccuracy(const Evaluation& evaluation, const std::set<InstanceId>& movers,
                        const RunCosts&) {
  if (!evaluation.labelled) return Measured::Undefined("the mesh has no labels");
  double sum = 0;
  int count = 0;
  for (const ObjectScores& object : evaluation.objects) {
    const Measured& rmse_m = object.accuracy.distance.rmse_m;
    if (!movers.contains(object.info.id) || !rmse_m.value) continue;
    sum += 1e3 * *rmse_m.value;
    ++count;
  }
  return count == 0 ? Measured::Undefined("no moving object was reconstructed")
                    : Measured::Of(sum / count);
}

Measured TableAccuracy(const Evaluation& evaluation, const std::set<InstanceId>&, const RunCosts&) {
  const Measured& rmse_m = TableOf(evaluation).accuracy.distance.rmse_m;
  return rmse_m.value ? Measured::Of(1e3 * *rmse_m.value) : rmse_m;
}

Measured Median(const RunCosts& costs, const char* step) {
  if (!costs.times) return Measured::Undefined("the mapper does not measure its steps");
  const nlohmann::json spread = costs.times->ToJson()[step];
  return spread.is_null() ? Measured::Undefined("no frame had this step")
                          : Measured::Of(spread["median_ms"].get<double>());
}

// What is measured besides an evaluation's columns: a row each.
struct RunMetric {
  SweepMetric metric;
  std::function<Measured(const Evaluation&, const std::set<InstanceId>& movers, const RunCosts&)>
      value;
};

// Of these, the first ones are an evaluation's.
constexpr std::size_t kAccuracies = 2;

const std::vector<RunMetric>& RunMetrics() {
  const auto median = [](const char* step) {
    return [step](const Evaluation&, const std::set<InstanceId>&, const RunCosts& costs) {
      return Median(costs, step);
    };
  };
  static const std::vector<RunMetric> metrics{
      {{"movers_accuracy_rmse_mm", "", "distance error of the moving objects", "mm", Better::kLower,
        2,
        "root mean square distance of the reconstruction to the truth, mean over the moving "
        "objects of which there is one: of those that are lost their completion speaks"},
       MoversAccuracy},
      {{"table_accuracy_rmse_mm", "", "distance error of the table", "mm", Better::kLower, 2,
        "root mean square distance to the truth of the background's reconstruction that is nearest "
        "to the table"},
       TableAccuracy},
      {{kFrameTimeMetric, "", "time to map a frame", "ms", Better::kLower, 2,
        "median wall-clock time of a frame, all steps together"},
       [](const Evaluation&, const std::set<InstanceId>&, const RunCosts& costs) {
         return costs.frame_s.empty() ? Measured::Undefined("no frame was mapped")
                                      : Measured::Of(1e3 * MedianOf(costs.frame_s));
       }},
      {{"move_ms", "move ms", "time to move objects, a frame", "ms", Better::kLower, 2,
        "median wall-clock time a frame of the pose update (III-E)"},
       median("update_poses")},
      {{"fuse_ms", "fuse ms", "time to fuse, a frame", "ms", Better::kLower, 2,
        "median wall-clock time a frame of the fusion (III-F)"},
       median("fuse")},
      {{"mesh_ms", "", "time to mesh the scene", "ms", Better::kLower, 2,
        "median wall-clock time of the visible scene's mesh"},
       median("mesh_scene")},
      {{"map_mb", "MB", "size of the map", "MB", Better::kLower, 1,
        "bytes of the map's blocks and tables at the examined frame"},
       [](const Evaluation&, const std::set<InstanceId>&, const RunCosts& costs) {
         return costs.bytes ? Measured::Of(static_cast<double>(*costs.bytes) / 1e6)
                            : Measured::Undefined("the mapper does not tell its size");
       }},
  };
  return metrics;
}

}  // namespace

const std::vector<SweepMetric>& SweepMetrics() {
  static const std::vector<SweepMetric> metrics = [] {
    std::vector<SweepMetric> all;
    for (const EvaluationColumn& column : EvaluationColumns()) {
      all.push_back({column.csv, column.title, column.words, column.unit, column.better,
                     column.decimals, column.definition, column.can_exceed_one});
    }
    for (const RunMetric& of_run : RunMetrics()) all.push_back(of_run.metric);
    return all;
  }();
  return metrics;
}

std::optional<double> MostOf(const SweepMetric& metric) {
  return metric.unit.empty() && !metric.can_exceed_one ? std::optional(1.0) : std::nullopt;
}

const SweepMetric* FindMetric(std::string_view name) {
  for (const SweepMetric& metric : SweepMetrics()) {
    if (metric.name == name) return &metric;
  }
  return nullptr;
}

std::size_t MetricIndex(std::string_view name) {
  const SweepMetric* metric = FindMetric(name);
  if (metric == nullptr) std::abort();  // configurations are checked
  return static_cast<std::size_t>(metric - SweepMetrics().data());
}

std::size_t EvaluationMetricCount() { return EvaluationColumns().size() + kAccuracies; }

std::vector<Measured> MeasureAll(const Evaluation& evaluation, const std::set<InstanceId>& movers,
                                 const RunCosts& costs) {
  std::vector<Measured> values;
  for (const EvaluationColumn& column : EvaluationColumns()) {
    values.push_back(column.value(movers, evaluation));
  }
  for (const RunMetric& of_run : RunMetrics()) {
    values.push_back(of_run.value(evaluation, movers, costs));
  }
  return values;
}

nlohmann::json MetricsJson() {
  nlohmann::json list = nlohmann::json::array();
  for (const SweepMetric& metric : SweepMetrics()) {
    list.push_back({{"name", metric.name},
                    {"title", metric.title},
                    {"words", metric.words},
                    {"unit", metric.unit},
                    {"better", metric.better == Better::kHigher ? "higher" : "lower"},
                    {"decimals", metric.decimals},
                    {"definition", metric.definition}});
  }
  return list;
}

std::string MetricsMarkdown() {
  // A bar would end the cell.
  const auto cell = [](const std::string& text) {
    std::string safe;
    for (const char c : text) {
      if (c == '|') safe += '\\';
      safe += c;
    }
    return safe;
  };
  std::string text = "| metric | in tables | unit | better | meaning |\n|---|---|---|---|---|\n";
  for (const SweepMetric& metric : SweepMetrics()) {
    text +=
        fmt::format("| `{}` | {} | {} | {} | {} |\n", metric.name, metric.title, metric.unit,
                    metric.better == Better::kHigher ? "higher" : "lower", cell(metric.definition));
  }
  return text;
}

}  // namespace tsdfpp
