// What a comparison says: the terminal's table, summary.json, frames.csv, report.html
// (docs/formats.md).
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "eval/compare.h"
#include "eval/pictures.h"

namespace tsdfpp {

// The figures of the examined frame (the reveal, else the last), a row a map; columns are explained
// in docs/metrics.md.
std::string SummaryTable(const CompareResult& result);

nlohmann::json SummaryJson(const CompareResult& result, const std::string& command);

// summary.json and frames.csv (a row an evaluated frame and map). Errors: kEnvironment.
Expected<void> WriteSummary(const CompareResult& result, const std::string& command,
                            const std::filesystem::path& out);

// report.html, with the pictures inside it. Errors: kEnvironment.
Expected<void> WriteReport(const CompareResult& result, const std::vector<PictureFile>& pictures,
                           const std::string& command, const std::filesystem::path& out);

}  // namespace tsdfpp
