// Verdicts of gates for a report's page (docs/report.md).
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>

#include "core/error.h"

namespace tsdfpp {

// What the page shows of `file`, a gates.json that `tsdfpp gate` wrote: its fields, and under
// "pictures" the pictures of gates that do not hold, by gate, as data URLs. Errors: kData where the
// file is missing, unreadable or not of the form that it should have; a picture that is missing is
// left out.
Expected<nlohmann::json> ReadGateResults(const std::filesystem::path& file);

}  // namespace tsdfpp
