// What stats.json of `tsdfpp map` says of a map.
#pragma once

#include <nlohmann/json.hpp>
#include <vector>

#include "cli/map_start.h"
#include "eval/picture/map_output.h"

namespace tsdfpp {

// Method, settings, times and memory of what was mapped from `start`, with the objects that were
// removed from it at the end. What belongs to the command's folder is for the caller to add: the
// run's id, and the files that the map was loaded from and saved to.
nlohmann::json StatsOf(const MapStart& start, const RunTimes& times,
                       const std::vector<InstanceId>& removed, const MapMemory& memory);

}  // namespace tsdfpp
