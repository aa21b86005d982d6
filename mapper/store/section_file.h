// A file of named sections, compressed and checksummed (docs/map.md, "The map file").
#pragma once

#include <map>
#include <string>
#include <string_view>

#include "core/error.h"

namespace tsdfpp {

// By name: four characters.
using Sections = std::map<std::string, std::string>;

// The whole file. The same sections give the same bytes for any number of threads.
std::string PackSections(const Sections& sections);

// Errors: kData, in one sentence that begins with `where`: a foreign file, one of another byte
// order, of a newer version, cut short, longer than it says, or damaged anywhere.
Expected<Sections> UnpackSections(std::string_view file, const std::string& where);

}  // namespace tsdfpp
