// What gates leave behind: a table, JSON, JUnit XML, and Markdown for a pull request
// (docs/gates.md).
#pragma once

#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <string>

#include "eval/gate/gate_explain.h"
#include "eval/gate/gate_run.h"

namespace tsdfpp {

inline constexpr int kGatesSchema = 1;
inline constexpr const char* kGatePictures = "pictures";  // beside gates.json

// A line a control, gate and sabotage, and what it comes to; `colour` marks verdicts for a
// terminal.
std::string GateTable(const GateRun& run, bool colour);

using GateExplanations = std::map<std::string, GateExplanation>;  // by gate

// `explanations` are of gates that do not hold.
nlohmann::json GateJson(const GateRun& run, const GateExplanations& explanations);

// A suite of test cases, one a control, gate and sabotage: an inconclusive or invalid gate is an
// error, a failed one a failure.
std::string GateJUnit(const GateRun& run);

// A table of the gates with the change against the reference; below, what is behind those that do
// not hold, with pictures.
std::string GateMarkdown(const GateRun& run, const GateExplanations& explanations);

// gates.junit.xml, gates.md and, last, gates.json below `out`. Errors: kEnvironment.
Expected<void> WriteGateReports(const GateRun& run, const GateExplanations& explanations,
                                const std::filesystem::path& out);

// Removes an earlier gates.json, which what is written next does not belong to. Errors:
// kEnvironment.
Expected<void> RemoveGateReport(const std::filesystem::path& out);

}  // namespace tsdfpp
