#include "eval/run/compare_names.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>

namespace tsdfpp {
namespace {

constexpr std::array<std::string_view, 16> kNames{
    kSummaryFile, kFramesFile, kTableFile,        kPageFile,      kRecordFolder,  "report.mp4",
    "run.json",   "lock",      "log.txt",         "mesh",         "trajectories", "frames",
    "gates.json", "gates.md",  "gates.junit.xml", "sequence.json"};
constexpr std::array<std::string_view, 3> kBeginnings{".", "figure-", "table-"};
constexpr std::array<std::string_view, 2> kProfiles{"_paper", "_close"};
constexpr std::array<PoseSource, 3> kPoseSources{PoseSource::kGiven, PoseSource::kIcp,
                                                 PoseSource::kTrack};

}  // namespace

std::string RunFolderName(Method method, std::string_view profile, PoseSource poses) {
  std::string name = fmt::format("{}_{}_{}", MethodName(method), profile, PoseSourceName(poses));
  std::replace(name.begin(), name.end(), '/', '-');
  return name;
}

bool IsCompareName(std::string_view given) {
  std::string name(given);
  std::transform(name.begin(), name.end(), name.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  const auto begins = [&](std::string_view with) { return name.starts_with(with); };
  const auto ends_as_a_map = [&](PoseSource poses) {
    return std::any_of(kProfiles.begin(), kProfiles.end(), [&](std::string_view profile) {
      return name.ends_with(fmt::format("{}_{}", profile, PoseSourceName(poses)));
    });
  };
  return std::find(kNames.begin(), kNames.end(), name) != kNames.end() ||
         std::any_of(kBeginnings.begin(), kBeginnings.end(), begins) ||
         std::any_of(kPoseSources.begin(), kPoseSources.end(), ends_as_a_map);
}

}  // namespace tsdfpp
