// The names that tsdfpp compare gives to what it writes into its output folder.
#pragma once

#include <string>
#include <string_view>

#include "mapper/map_config.h"
#include "mapper/pipeline.h"

namespace tsdfpp {

// The folder of one map, e.g. "tsdf++-literal_paper_gt".
std::string RunFolderName(Method method, std::string_view profile, PoseSource poses);

// Whether compare, or report on what it wrote, may itself use this name in the output folder,
// whatever its settings; letters' case does not matter. An adapter's folder cannot have it.
bool IsCompareName(std::string_view name);

}  // namespace tsdfpp
