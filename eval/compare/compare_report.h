// What a comparison leaves: summary.json, frames.csv, table.txt, report.html
// (docs/command-line.md).
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "eval/compare/compare.h"
#include "eval/compare/pictures.h"

namespace tsdfpp {

nlohmann::json SummaryJson(const CompareResult& result, const std::string& command);

// summary.json, frames.csv (a row an evaluated frame and map) and table.txt (FrontTable and
// SummaryTable without times). Errors: kEnvironment.
Expected<void> WriteSummary(const CompareResult& result, const std::string& command,
                            const std::filesystem::path& out);

// report.html, with the pictures inside it. Errors: kEnvironment.
Expected<void> WriteReport(const CompareResult& result, const std::vector<PictureFile>& pictures,
                           const std::string& command, const std::filesystem::path& out);

}  // namespace tsdfpp
