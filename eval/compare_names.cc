#include "eval/compare_names.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <string>

namespace tsdfpp {

bool IsNameOfCompare(std::string_view given) {
  std::string name(given);
  std::transform(name.begin(), name.end(), name.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  constexpr std::array<std::string_view, 13> kNames{
      kSummaryFile, kFramesFile, kTableFile,       kPageFile,      kRecordFolder,
      "report.mp4", "run.json",  "mesh",           "trajectories", "frames",
      "gates.json", "gates.md",  "gates.junit.xml"};
  constexpr std::array<std::string_view, 2> kBeginnings{"figure-", "table-"};
  constexpr std::array<std::string_view, 2> kProfiles{"_paper", "_close"};
  constexpr std::array<std::string_view, 2> kPoses{"_gt", "_icp"};
  const auto begins = [&](std::string_view with) { return name.starts_with(with); };
  return std::find(kNames.begin(), kNames.end(), name) != kNames.end() ||
         std::any_of(kBeginnings.begin(), kBeginnings.end(), begins) ||
         std::any_of(kPoses.begin(), kPoses.end(), [&](std::string_view poses) {
           if (!name.ends_with(poses)) return false;
           const std::string_view rest =
               std::string_view(name).substr(0, name.size() - poses.size());
           return std::any_of(kProfiles.begin(), kProfiles.end(),
                              [&](std::string_view profile) { return rest.ends_with(profile); });
         });
}

}  // namespace tsdfpp
