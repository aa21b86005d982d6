#include "eval/sweep/sweep_report.h"

#include <algorithm>

#include "core/files.h"
#include "core/json_text.h"

namespace tsdfpp {
namespace {

// A field of a CSV file (RFC 4180).
std::string Field(const std::string& text) {
  if (text.find_first_of(",\"\n") == std::string::npos) return text;
  std::string quoted;
  quoted.push_back('"');
  for (const char c : text) {
    if (c == '"') quoted.push_back(c);
    quoted.push_back(c);
  }
  quoted.push_back('"');
  return quoted;
}

nlohmann::json MeanJson(const MeanFigure& figure) {
  nlohmann::json json{{"count", figure.count}, {"mean", ToJson(figure.mean)}};
  if (figure.interval.value) {
    json["low"] = figure.interval.value->low;
    json["high"] = figure.interval.value->high;
  }
  return json;
}

nlohmann::json PairedJson(const PairedComparison& paired) {
  nlohmann::json json{{"pairs", paired.pairs},
                      {"mean_difference", ToJson(paired.mean_difference)},
                      {"median_difference", ToJson(paired.median_difference)},
                      {"cohens_dz", ToJson(paired.cohens_dz)},
                      {"hedges_gz", ToJson(paired.hedges_gz)},
                      {"superiority", ToJson(paired.superiority)},
                      {"rank_biserial", ToJson(paired.rank_biserial)}};
  if (paired.interval.value) {
    json["low"] = paired.interval.value->low;
    json["high"] = paired.interval.value->high;
  }
  return json;
}

nlohmann::json ConditionJson(const Condition& condition) {
  nlohmann::json json{{"grid", condition.grid},
                      {"replicates", condition.replicates},
                      {"methods", condition.methods}};
  for (const auto& [axis, value] : condition.settings) json["settings"][axis] = AxisJson(value);
  json["paired"] = nlohmann::json::object();
  for (const auto& [which, figure] : condition.means) {
    json["means"][which.first][which.second] = MeanJson(figure);
  }
  for (const auto& [which, paired] : condition.paired) {
    json["paired"][which.first][which.second] = PairedJson(paired);
  }
  return json;
}

nlohmann::json FramesJson(const SequenceVariant& variant, const std::string& id) {
  return {{"scene", fmt::format("sequences/{}/scene.toml", id)},
          {"name", variant.scene.name},
          {"width", variant.scene.intrinsics.width},
          {"height", variant.scene.intrinsics.height},
          {"frames", variant.frames},
          {"evaluated", variant.evaluated},
          {"examined", variant.examined},
          {"fuse_until", variant.fuse_until},
          {"object_error", variant.object_error}};
}

nlohmann::json CellsJson(const SweepResult& result) {
  nlohmann::json cells = nlohmann::json::object();
  for (const SweepResult::Entry& entry : result.entries) {
    nlohmann::json& json = cells[entry.cell.id];
    json["grids"].push_back(entry.grid);
    json["sequence"] = entry.cell.sequence;
    json["settings"] = SettingsJson(entry.cell.settings);
    for (std::size_t m = 0; m < SweepMetrics().size(); ++m) {
      json["examined"][SweepMetrics()[m].name] = ToJson(entry.result.examined[m]);
    }
  }
  return cells;
}

// "0.981 [0.970, 0.990]".
std::string WithInterval(const SweepMetric& metric, const Measured& value,
                         const MeasuredInterval& interval, bool sign) {
  if (!value.value) return fmt::format("undefined ({})", value.why_not);
  std::string text = sign ? fmt::format("{:+.{}f}", *value.value, metric.decimals)
                          : fmt::format("{:.{}f}", *value.value, metric.decimals);
  if (interval.value) {
    text += fmt::format(" [{:.{}f}, {:.{}f}]", interval.value->low, metric.decimals,
                        interval.value->high, metric.decimals);
  }
  return metric.unit.empty() ? text : fmt::format("{} {}", text, metric.unit);
}

std::string MetricText(const ExperimentConfig& config, const SweepMetric& metric,
                       const Condition& condition) {
  std::string text = metric.words + ": ";
  bool first = true;
  for (const std::string& method : condition.methods) {
    const MeanFigure& figure = condition.means.at({method, metric.name});
    text += fmt::format("{}{} {}", first ? "" : "; ", method,
                        WithInterval(metric, figure.mean, figure.interval, false));
    if (figure.count > 0 && figure.count < condition.replicates) {
      text += fmt::format(" (of {} of {})", figure.count, condition.replicates);
    }
    first = false;
    const auto paired = condition.paired.find({method, metric.name});
    if (paired == condition.paired.end() || !paired->second.mean_difference.value) continue;
    const PairedComparison& p = paired->second;
    text += fmt::format(" ({} to {}", WithInterval(metric, p.mean_difference, p.interval, true),
                        config.baseline);
    if (p.pairs > 1) {
      const double larger = *p.superiority.value;
      const double better = metric.better == Better::kHigher ? larger : 1 - larger;
      text += fmt::format(", better in {:.0f} % of {} pairs", 100 * better, p.pairs);
    } else if (condition.replicates > 1) {
      text += ", of one pair";
    }
    text += ")";
  }
  return text + ".\n";
}

// Whether a method's figure is better than the baseline's: the difference's interval, or the one
// difference, does not reach 0.
bool IsAhead(const PairedComparison& paired, Better better) {
  if (!paired.mean_difference.value) return false;
  const auto& interval = paired.interval.value;
  return better == Better::kHigher
             ? (interval ? interval->low : *paired.mean_difference.value) > 0
             : (interval ? interval->high : *paired.mean_difference.value) < 0;
}

// The conditions in which a method is not ahead of the baseline, or in which nobody knows.
std::string NotAhead(const ExperimentConfig& config, const std::vector<Condition>& conditions,
                     const std::vector<std::string>& varied) {
  const SweepMetric& metric = *FindMetric(config.metrics.front());
  std::map<std::string, std::vector<std::string>> where;
  std::map<std::string, std::size_t> asked;
  for (const Condition& condition : conditions) {
    for (const std::string& method : condition.methods) {
      const auto paired = condition.paired.find({method, metric.name});
      if (paired == condition.paired.end()) continue;
      ++asked[method];
      if (IsAhead(paired->second, metric.better)) continue;
      std::string text = ConditionText(condition, varied, config.grids.size() > 1);
      if (text.empty()) text = "in its one condition";
      if (!paired->second.mean_difference.value) text += " (undefined)";
      where[method].push_back(text);
    }
  }
  std::string text;
  for (const auto& [method, count] : asked) {
    const auto found = where.find(method);
    if (found == where.end()) {
      text += fmt::format("{} is ahead of {} in {} everywhere.\n", method, config.baseline,
                          metric.words);
    } else {
      text +=
          fmt::format("{} is not ahead of {} in {} ({} of {}): {}.\n", method, config.baseline,
                      metric.words, found->second.size(), count, fmt::join(found->second, "; "));
    }
  }
  return text;
}

}  // namespace

std::string SweepCsv(const SweepResult& result) {
  std::string csv = "grid,cell";
  for (const Axis& axis : Axes()) csv += fmt::format(",{}", axis.name);
  csv += ",frame,examined";
  for (const SweepMetric& metric : SweepMetrics()) csv += fmt::format(",{}", metric.name);
  csv += "\n";
  for (const SweepResult::Entry& entry : result.entries) {
    std::string start = fmt::format("{},{}", Field(entry.grid), entry.cell.id);
    for (const Axis& axis : Axes()) {
      start += fmt::format(",{}", Field(AxisText(axis.get(entry.cell.settings))));
    }
    for (const CellFrame& frame : entry.result.frames) {
      csv += fmt::format("{},{},{}", start, frame.frame, frame.examined ? 1 : 0);
      const std::vector<Measured>& values = frame.examined ? entry.result.examined : frame.values;
      for (std::size_t m = 0; m < SweepMetrics().size(); ++m) {
        const bool known = m < values.size() && values[m].value;
        csv += known ? fmt::format(",{:.6g}", *values[m].value) : ",";
      }
      csv += "\n";
    }
  }
  return csv;
}

nlohmann::json SweepJson(const SweepResult& result, const std::vector<Condition>& conditions) {
  const ExperimentConfig& config = result.config;
  nlohmann::json metrics = nlohmann::json::object();
  for (const SweepMetric& metric : SweepMetrics()) {
    metrics[metric.name] = {{"words", metric.words},
                            {"unit", metric.unit},
                            {"better", metric.better == Better::kHigher ? "higher" : "lower"},
                            {"decimals", metric.decimals}};
  }
  nlohmann::json sequences = nlohmann::json::object();
  for (const auto& [id, variant] : result.sequences) sequences[id] = FramesJson(variant, id);
  nlohmann::json all = nlohmann::json::array();
  for (const Condition& condition : conditions) all.push_back(ConditionJson(condition));
  nlohmann::json json{{"schema", kResultsSchema},
                      {"kind", "tsdfpp experiment"},
                      {"program", result.program},
                      {"renderer", result.renderer},
                      {"experiment",
                       {{"name", config.name},
                        {"question", config.question},
                        {"metrics", config.metrics},
                        {"baseline", config.baseline},
                        {"replicates", config.replicates},
                        {"confidence", config.statistics.confidence},
                        {"resamples", config.statistics.resamples},
                        {"scale", config.frames.scale},
                        {"stride", config.frames.stride},
                        {"every", config.frames.every},
                        {"until", config.frames.until}}},
                      {"metrics", metrics},
                      {"varied", VariedAxes(conditions)},
                      {"conditions", all},
                      {"cells", CellsJson(result)},
                      {"sequences", sequences},
                      {"text", SweepText(result, conditions)}};
  if (config.plot) {
    json["plot"] = {{"x", config.plot->x},
                    {"x_label", config.plot->x_label},
                    {"log_x", config.plot->log_x},
                    {"metrics", config.plot->metrics}};
  }
  return json;
}

std::string SweepText(const SweepResult& result, const std::vector<Condition>& conditions) {
  const ExperimentConfig& config = result.config;
  const std::vector<std::string> varied = VariedAxes(conditions);
  std::size_t most = 0;
  for (const Condition& condition : conditions) most = std::max(most, condition.replicates);
  std::string text = fmt::format("{}: {}\n", config.name, config.question);
  text += fmt::format(
      "{} cells, images of {} times the size, every {} frame; at the examined frame, {}.\n",
      result.cells, config.frames.scale,
      config.frames.stride == 1 ? std::string("single")
                                : fmt::format("{}-th", config.frames.stride),
      most > 1 ? fmt::format("means over {} of up to {} runs with {:.0f} % bootstrap intervals",
                             fmt::join(config.replicates, " and "), most,
                             100 * config.statistics.confidence)
               : std::string("single runs"));
  for (const Condition& condition : conditions) {
    const std::string where = ConditionText(condition, varied, config.grids.size() > 1);
    for (const std::string& name : config.metrics) {
      text += fmt::format("{}{}", where.empty() ? "" : where + ": ",
                          MetricText(config, *FindMetric(name), condition));
    }
  }
  return text + NotAhead(config, conditions, varied);
}

Expected<void> WriteSweep(const SweepResult& result, const std::filesystem::path& out) {
  const std::vector<Condition> conditions = ConditionsOf(result);
  // The last one says that the others are of the same cells, so an old one goes first.
  std::error_code failure;
  std::filesystem::remove(out / "results.json", failure);
  if (failure) {
    return EnvironmentError("{}: cannot be removed ({})", (out / "results.json").string(),
                            failure.message());
  }
  TSDFPP_RETURN_IF_ERROR(WriteFile(out / "results.csv", SweepCsv(result)));
  TSDFPP_RETURN_IF_ERROR(WriteFile(out / "summary.txt", SweepText(result, conditions)));
  return WriteFile(out / "results.json", JsonText(SweepJson(result, conditions), 1) + "\n");
}

}  // namespace tsdfpp
