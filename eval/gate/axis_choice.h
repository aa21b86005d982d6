// Cells of an experiment, chosen by the values of its axes (docs/gates.md).
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "core/toml_reader.h"
#include "eval/sweep/experiment.h"

namespace tsdfpp {

// Names of values of axes, such as {"method": "tsdf++", "profile": "close"}.
using AxisChoice = std::map<std::string, AxisValue>;

// The choice that a table of a TOML file makes; `where` and `path` name file and table. Errors:
// kUsage, with file, line and key: an unknown axis, or a value that it has not.
Expected<AxisChoice> ReadAxisChoice(const toml::table& table, const std::string& where,
                                    const std::string& path);

// Of the experiment's cells those with these values, by replicate ("seed=2;"), in their order.
// `changed` is laid over the choice. Errors: kUsage, a clause without the gate's name.
Expected<std::map<std::string, CellSettings>> ChosenCells(const ExperimentConfig& config,
                                                          AxisChoice choice,
                                                          const AxisChoice& changed);

// The experiment of exactly these cells, without a plot.
ExperimentConfig WithCells(const ExperimentConfig& config, const std::vector<CellSettings>& cells);

// The experiment with these seeds in place of its own.
ExperimentConfig WithSeeds(ExperimentConfig config, const std::vector<std::uint64_t>& seeds);

// "method tsdf++, profile close".
std::string ChoiceText(const AxisChoice& choice);

}  // namespace tsdfpp
