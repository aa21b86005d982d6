// What `tsdfpp compare` calls its own in its output folder.
#pragma once

#include <string_view>

namespace tsdfpp {

inline constexpr const char* kSummaryFile = "summary.json";
inline constexpr const char* kFramesFile = "frames.csv";
inline constexpr const char* kTableFile = "table.txt";
inline constexpr const char* kPageFile = "report.html";
inline constexpr const char* kRecordFolder = "record";

// Whether a file or folder of this name is compare's, now or with other options, so that an adapter
// cannot have it: those above, pictures (figure-..., table-...), a map's folder
// (<method>_<profile>_<poses>), a run's note (eval/run_folder.h), what `tsdfpp report` adds and a
// gate's verdicts. Small and capital letters count as the same, as some file systems have it.
bool IsNameOfCompare(std::string_view name);

}  // namespace tsdfpp
