#include "eval/sweep/sweep_statistics.h"

#include <algorithm>
#include <set>

namespace tsdfpp {
namespace {

bool Contains(const std::vector<std::string>& words, const std::string& word) {
  return std::find(words.begin(), words.end(), word) != words.end();
}

struct Group {
  Condition condition;
  // By method, then replicate.
  std::map<std::string, std::map<std::string, const CellResult*>> cells;
};

void Summarise(const ExperimentConfig& config, Group& group) {
  std::set<std::string> replicates;
  for (const auto& [method, cells] : group.cells) {
    for (const auto& [replicate, cell] : cells) replicates.insert(replicate);
  }
  group.condition.replicates = replicates.size();
  const auto baseline = group.cells.find(config.baseline);
  for (std::size_t m = 0; m < SweepMetrics().size(); ++m) {
    const std::string& metric = SweepMetrics()[m].name;
    for (const auto& [method, cells] : group.cells) {
      std::vector<double> values;
      std::vector<double> ours;
      std::vector<double> theirs;
      for (const auto& [replicate, cell] : cells) {
        const Measured& value = cell->examined[m];
        if (!value.value) continue;
        values.push_back(*value.value);
        if (baseline == group.cells.end()) continue;
        const auto other = baseline->second.find(replicate);
        if (other == baseline->second.end() || !other->second->examined[m].value) continue;
        ours.push_back(*value.value);
        theirs.push_back(*other->second->examined[m].value);
      }
      MeanFigure& mean = group.condition.means[{method, metric}];
      mean.count = values.size();
      mean.mean =
          values.empty() ? cells.begin()->second->examined[m] : Measured::Of(MeanOf(values));
      mean.interval = BootstrapInterval(values, MeanOf, config.statistics);
      if (method != config.baseline && baseline != group.cells.end()) {
        group.condition.paired[{method, metric}] = ComparePaired(ours, theirs, config.statistics);
      }
    }
  }
}

}  // namespace

std::vector<Condition> ConditionsOf(const SweepResult& result) {
  std::vector<Group> groups;
  for (const SweepResult::Entry& entry : result.entries) {
    Condition condition;
    condition.grid = entry.grid;
    std::string replicate;
    std::string method;
    for (const Axis& axis : Axes()) {
      const AxisValue value = axis.get(entry.cell.settings);
      if (axis.name == "method") {
        method = AxisText(value);
      } else if (Contains(result.config.replicates, axis.name)) {
        replicate += fmt::format("{}={};", axis.name, AxisText(value));
      } else {
        condition.settings[axis.name] = value;
      }
    }
    auto group = std::find_if(groups.begin(), groups.end(), [&](const Group& other) {
      return other.condition.grid == condition.grid &&
             other.condition.settings == condition.settings;
    });
    if (group == groups.end()) group = groups.insert(groups.end(), {std::move(condition), {}});
    if (!Contains(group->condition.methods, method)) group->condition.methods.push_back(method);
    group->cells[method][replicate] = &entry.result;
  }
  std::vector<Condition> conditions;
  for (Group& group : groups) {
    Summarise(result.config, group);
    conditions.push_back(std::move(group.condition));
  }
  return conditions;
}

std::vector<std::string> VariedAxes(const std::vector<Condition>& conditions) {
  std::vector<std::string> varied;
  for (const Axis& axis : Axes()) {
    std::set<AxisValue> values;
    for (const Condition& condition : conditions) {
      const auto value = condition.settings.find(axis.name);
      if (value != condition.settings.end()) values.insert(value->second);
    }
    if (values.size() > 1) varied.push_back(axis.name);
  }
  return varied;
}

std::string ConditionText(const Condition& condition, const std::vector<std::string>& varied,
                          bool several_grids) {
  std::string text = several_grids ? condition.grid : std::string();
  for (const std::string& axis : varied) {
    // A file's name, where the grid's says it already.
    if (axis == "scene" && several_grids) continue;
    text += fmt::format("{}{} {}", text.empty() ? "" : ", ", axis,
                        AxisText(condition.settings.at(axis)));
  }
  return text;
}

}  // namespace tsdfpp
