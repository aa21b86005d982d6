// `tsdfpp report`: comparisons on disk as one HTML file that needs nothing else (docs/report.md).
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "core/error.h"

namespace tsdfpp {

// Pages stay below it: key frames are left out, evenly, until the recordings fit.
inline constexpr std::size_t kLargestPage_bytes = 25'000'000;

struct ReportPage {
  std::string html;
  // What was left out to stay below the limit, in sentences for the user.
  std::vector<std::string> remarks;
};

// The page of the comparisons in `folders` (what `tsdfpp compare` wrote; one or two), made by
// `command`, with the verdicts in `gates` (a gates.json that `tsdfpp gate` wrote) where that is not
// empty. Nothing that they hold can act as markup or as a script. Errors: kData where a file is
// missing, unreadable or not of the form that it should have; kEnvironment where this build has no
// page.
Expected<ReportPage> MakeReportPage(const std::vector<std::filesystem::path>& folders,
                                    const std::string& command,
                                    std::size_t largest_bytes = kLargestPage_bytes,
                                    const std::filesystem::path& gates = {});

}  // namespace tsdfpp
