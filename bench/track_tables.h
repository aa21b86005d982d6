// What bench/track.h writes of its rows.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "bench/track_scores.h"
#include "core/error.h"
#include "mapper/track/track_log.h"

namespace tsdfpp {

// One object in one run.
struct TrackRow {
  std::string scene;
  std::string depth;
  std::uint64_t seed = 0;
  std::string run;
  std::string object;
  TrackScores scores{};
  TrackSpan span{};
  std::size_t shown = 0;
  double shift_share = 0;
  double turn_share = 0;
  double ms = 0;  // an object and frame, the median of the run
};

// What the rows are of, in the order of the tables.
struct TrackTables {
  std::vector<std::string> depths;
  std::vector<std::string> runs;
};

// Writes the files that bench/track.h lists. Errors: kEnvironment where `out` cannot be written.
Expected<void> WriteTrackTables(const std::vector<TrackRow>& rows, const TrackTables& tables,
                                const std::filesystem::path& out);

}  // namespace tsdfpp
