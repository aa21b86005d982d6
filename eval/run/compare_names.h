// The names that tsdfpp compare gives to what it writes into its output folder.
#pragma once

#include <string>
#include <string_view>

#include "mapper/map_config.h"
#include "mapper/pipeline.h"

namespace tsdfpp {

inline constexpr const char* kSummaryFile = "summary.json";
inline constexpr const char* kFramesFile = "frames.csv";
inline constexpr const char* kTableFile = "table.txt";
inline constexpr const char* kPageFile = "report.html";
inline constexpr const char* kRecordFolder = "record";

// The folder of one map, e.g. "tsdf++-literal_paper_gt".
std::string RunFolderName(Method method, std::string_view profile, PoseSource poses);

// Whether a file or folder of this name is compare's, now or with other options, so that an adapter
// cannot have it: those above, pictures (figure-..., table-...), a map's folder
// (<method>_<profile>_<poses>), a run's note (eval/run/run_folder.h), what `tsdfpp report` adds and
// a gate's verdicts. Small and capital letters count as the same, as some file systems have it.
bool IsCompareName(std::string_view name);

}  // namespace tsdfpp
