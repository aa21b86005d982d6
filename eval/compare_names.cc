#include "eval/compare_names.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>

namespace tsdfpp {
namespace {

constexpr std::array<std::string_view, 11> kCompareFiles = {
    "frames",     "frames.csv", "lock",          "log.txt",      "record",   "report.html",
    "report.mp4", "run.json",   "sequence.json", "summary.json", "table.txt"};

}  // namespace

std::string RunFolderName(Method method, std::string_view profile, PoseSource poses) {
  std::string name = fmt::format("{}_{}_{}", MethodName(method), profile, PoseSourceName(poses));
  std::replace(name.begin(), name.end(), '/', '-');
  return name;
}

bool IsCompareName(std::string_view name) {
  std::string lower(name);
  std::transform(lower.begin(), lower.end(), lower.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  if (lower.starts_with('.') || lower.starts_with("figure-") || lower.starts_with("table-")) {
    return true;
  }
  if (std::find(kCompareFiles.begin(), kCompareFiles.end(), lower) != kCompareFiles.end()) {
    return true;
  }
  for (const Method method : AllMethods()) {
    for (const char* profile : {"paper", "close"}) {
      for (const PoseSource poses : {PoseSource::kGiven, PoseSource::kIcp}) {
        if (lower == RunFolderName(method, profile, poses)) return true;
      }
    }
  }
  return false;
}

}  // namespace tsdfpp
