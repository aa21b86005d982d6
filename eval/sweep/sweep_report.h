// What an experiment leaves behind: results.csv, results.json, and a paragraph of plain numbers
// (docs/experiments.md).
#pragma once

#include <array>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "eval/sweep/sweep.h"
#include "eval/sweep/sweep_statistics.h"

namespace tsdfpp {

inline constexpr int kResultsSchema = 1;
// What WriteSweep writes.
inline constexpr std::array kSweepFiles{"results.csv", "results.json", "summary.txt"};

// A row an entry and evaluated frame: grid, cell, settings, frame, whether it is the examined one,
// and every metric; empty where one is undefined or not known at that frame.
std::string SweepCsv(const SweepResult& result);

nlohmann::json SweepJson(const SweepResult& result, const std::vector<Condition>& conditions);

// The question, then what the experiment's metrics are in each condition, with intervals and paired
// differences, and where no method is ahead of the baseline.
std::string SweepText(const SweepResult& result, const std::vector<Condition>& conditions);

// results.csv, results.json and summary.txt below `out`. Errors: kEnvironment.
Expected<void> WriteSweep(const SweepResult& result, const std::filesystem::path& out);

}  // namespace tsdfpp
