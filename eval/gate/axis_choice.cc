#include "eval/gate/axis_choice.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>

namespace tsdfpp {

Expected<AxisChoice> ReadAxisChoice(const toml::table& table, const std::string& where,
                                    const std::string& path) {
  TomlReader reader(table, where, path);
  AxisChoice choice;
  for (const Axis& axis : Axes()) {
    const toml::node* node = table.get(axis.name);
    if (node == nullptr) continue;
    AxisValue value;
    if (node->is_string()) {
      std::string text;
      reader.Get(axis.name, text);
      value = text;
    } else {
      double number = 0;
      reader.Get(axis.name, number);
      value = number;
    }
    CellSettings probe;
    if (auto set = axis.set(probe, value); !set) {
      reader.Fault(axis.name, set.error().message);
    } else {
      choice[axis.name] = axis.get(probe);
    }
  }
  TSDFPP_RETURN_IF_ERROR(reader.Finish());
  return choice;
}

std::string ChoiceText(const AxisChoice& choice) {
  std::string text;
  for (const auto& [axis, value] : choice) {
    text += fmt::format("{}{} {}", text.empty() ? "" : ", ", axis, AxisText(value));
  }
  return text;
}

Expected<std::map<std::string, CellSettings>> ChosenCells(const ExperimentConfig& config,
                                                          AxisChoice choice,
                                                          const AxisChoice& changed) {
  for (const auto& [axis, value] : changed) choice[axis] = value;
  std::map<std::string, CellSettings> chosen;
  std::map<std::string, std::string> rest;  // by replicate: the other axes
  std::optional<AxisChoice> first;
  for (const PlannedCell& cell : CellsOf(config)) {
    std::string replicate;
    AxisChoice others;
    bool fits = true;
    for (const Axis& axis : Axes()) {
      const AxisValue value = axis.get(cell.settings);
      const auto wanted = choice.find(axis.name);
      fits = fits && (wanted == choice.end() || wanted->second == value);
      if (std::find(config.replicates.begin(), config.replicates.end(), axis.name) !=
          config.replicates.end()) {
        replicate += fmt::format("{}={};", axis.name, AxisText(value));
      } else {
        others[axis.name] = value;
      }
    }
    if (!fits) continue;
    if (!first) first = others;
    for (const auto& [axis, value] : others) {
      if (first->at(axis) == value) continue;
      return UsageError("leaves cells that differ in {} ({} and {}): expected one value of it",
                        axis, AxisText(first->at(axis)), AxisText(value));
    }
    chosen.emplace(replicate, cell.settings);
  }
  if (chosen.empty()) {
    return UsageError("({}) leaves no cell of experiment '{}'", ChoiceText(choice), config.name);
  }
  return chosen;
}

ExperimentConfig WithCells(const ExperimentConfig& config, const std::vector<CellSettings>& cells) {
  ExperimentConfig only = config;
  only.grids.clear();
  only.plot.reset();
  const CellSettings defaults;
  for (const CellSettings& settings : cells) {
    ExperimentGrid grid;
    grid.name = std::to_string(only.grids.size() + 1);
    for (const Axis& axis : Axes()) {
      const AxisValue value = axis.get(settings);
      if (value != axis.get(defaults)) grid.values[axis.name] = {value};
    }
    only.grids.push_back(std::move(grid));
  }
  return only;
}

ExperimentConfig WithSeeds(ExperimentConfig config, const std::vector<std::uint64_t>& seeds) {
  for (ExperimentGrid& grid : config.grids) {
    auto& values = grid.values["seed"];
    values.clear();
    for (const std::uint64_t seed : seeds) values.emplace_back(static_cast<double>(seed));
  }
  return config;
}

}  // namespace tsdfpp
