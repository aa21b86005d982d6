#include "eval/sweep_metrics.h"

#include <cstdlib>

#include "eval/evaluation_columns.h"
#include "metrics/statistics.h"

namespace tsdfpp {
namespace {

// Words and direction of the evaluation's columns, by name.
struct Words {
  const char* name;
  const char* words;
  const char* unit;
  Better better;
};
constexpr Words kEvaluationWords[] = {
    {"table_preservation_behind_other", "hidden table kept", "", Better::kHigher},
    {"table_retention_behind_other", "retention of the hidden table", "", Better::kHigher},
    {"table_hole_area_cm2", "hole in the table", "cm²", Better::kLower},
    {"visible_completion", "visible completion", "", Better::kHigher},
    {"table_visible_completion", "visible completion of the table", "", Better::kHigher},
    {"movers_completion", "completion of the moving objects", "", Better::kHigher},
    {"ghost_area_cm2", "ghost area", "cm²", Better::kLower},
    {"revealed_ghost_area_cm2", "ghost area after the removal", "cm²", Better::kLower},
    {"revealed_unseen_area_cm2", "surface in unseen space after the removal", "cm²",
     Better::kLower},
    {"sanity_all", "right pixels", "", Better::kHigher},
    {"sanity_least", "right pixels of the worst object", "", Better::kHigher},
    {"seam_share", "missing background beside objects", "", Better::kLower},
    {"seam_area_cm2", "ring of missing background around objects", "cm²", Better::kLower},
    {"bulge_share", "background beside objects hidden by bulges", "", Better::kLower},
    {"table_preservation_any_label", "hidden table kept under any label", "", Better::kHigher},
    {"table_label_purity", "purity of the table", "", Better::kHigher},
};

// Root mean square distance of the reconstruction to the truth, mean over the moving objects.
Measured MoversAccuracy(const Evaluation& evaluation, const std::set<InstanceId>& movers) {
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

Measured TableAccuracy(const Evaluation& evaluation) {
  const Measured& rmse_m = evaluation.objects.front().accuracy.distance.rmse_m;
  return rmse_m.value ? Measured::Of(1e3 * *rmse_m.value) : rmse_m;
}

Measured Median(const RunCosts& costs, const char* step) {
  if (!costs.times) return Measured::Undefined("the mapper does not measure its steps");
  const nlohmann::json spread = costs.times->ToJson()[step];
  return spread.is_null() ? Measured::Undefined("no frame had this step")
                          : Measured::Of(spread["median_ms"].get<double>());
}

}  // namespace

const std::vector<SweepMetric>& SweepMetrics() {
  static const std::vector<SweepMetric> metrics = [] {
    std::vector<SweepMetric> all;
    for (const EvaluationColumn& column : EvaluationColumns()) {
      SweepMetric metric{column.csv, column.csv, "", Better::kHigher, column.decimals};
      for (const Words& words : kEvaluationWords) {
        if (column.csv != words.name) continue;
        metric.words = words.words;
        metric.unit = words.unit;
        metric.better = words.better;
      }
      all.push_back(std::move(metric));
    }
    all.push_back({"movers_accuracy_rmse_mm", "distance error of the moving objects", "mm",
                   Better::kLower, 2});
    all.push_back(
        {"table_accuracy_rmse_mm", "distance error of the table", "mm", Better::kLower, 2});
    all.push_back({kFrameTimeMetric, "time to map a frame", "ms", Better::kLower, 2});
    all.push_back({"move_ms", "time to move objects, a frame", "ms", Better::kLower, 2});
    all.push_back({"fuse_ms", "time to fuse, a frame", "ms", Better::kLower, 2});
    all.push_back({"mesh_ms", "time to mesh the scene", "ms", Better::kLower, 2});
    all.push_back({"map_mb", "size of the map", "MB", Better::kLower, 1});
    return all;
  }();
  return metrics;
}

std::optional<double> MostOf(const SweepMetric& metric) {
  // Retention is relative to an earlier score, which a map can exceed.
  const bool share = metric.unit.empty() && metric.name.find("retention") == std::string::npos;
  return share ? std::optional(1.0) : std::nullopt;
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

std::size_t EvaluationMetricCount() { return EvaluationColumns().size() + 2; }

std::vector<Measured> MeasureAll(const Evaluation& evaluation, const std::set<InstanceId>& movers,
                                 const RunCosts& costs) {
  std::vector<Measured> values;
  for (const EvaluationColumn& column : EvaluationColumns()) {
    values.push_back(column.value(movers, evaluation));
  }
  values.push_back(MoversAccuracy(evaluation, movers));
  values.push_back(TableAccuracy(evaluation));
  values.push_back(costs.frame_s.empty() ? Measured::Undefined("no frame was mapped")
                                         : Measured::Of(1e3 * MedianOf(costs.frame_s)));
  for (const char* step : {"update_poses", "fuse", "mesh_scene"}) {
    values.push_back(Median(costs, step));
  }
  values.push_back(costs.bytes ? Measured::Of(static_cast<double>(*costs.bytes) / 1e6)
                               : Measured::Undefined("the mapper does not tell its size"));
  return values;
}

}  // namespace tsdfpp
