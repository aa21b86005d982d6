// Folders without exceptions: the standard library's iterators throw as they go on, and its
// absolute() where the working folder is gone.
#pragma once

#include <filesystem>
#include <set>
#include <string>
#include <vector>

#include "core/error.h"

namespace tsdfpp {

// What lies directly in a folder, in order of the names. Errors: kData where it cannot be read.
Expected<std::vector<std::filesystem::path>> ListFolder(const std::filesystem::path& folder);

// The same, or none where it cannot be read.
std::vector<std::filesystem::path> EntriesOf(const std::filesystem::path& folder);

// All that is no folder in the folder and below, in order of the paths; links to folders are not
// entered. Errors: kData where a folder cannot be read.
Expected<std::vector<std::filesystem::path>> ListFilesBelow(const std::filesystem::path& folder);

// Whether there is anything of this name, links followed; what cannot be looked at is not there.
bool IsThere(const std::filesystem::path& path);
bool IsFolder(const std::filesystem::path& path);

// The absolute path; the path as it is where the working folder is gone.
std::filesystem::path AbsolutePath(const std::filesystem::path& path);

// The one absolute path of all that name the same thing, there or not, links followed.
std::filesystem::path TruePath(const std::filesystem::path& path);

// Whether `path` is, or would be, `place` or in it, links followed; never in the empty path.
bool LiesIn(const std::filesystem::path& path, const std::filesystem::path& place);

// Whether a file can be put at `place`, a path within `folder`. Errors: kUsage where a folder on
// the way is a link, which would lead the file elsewhere, or is a file. What of these is `going`,
// paths within `folder` as well, is removed before and may be anything.
Expected<void> CheckWay(const std::filesystem::path& folder, const std::filesystem::path& place,
                        const std::set<std::string>& going = {});

// A folder's own name, also where the path ends with a slash or is "."
std::string OwnName(const std::filesystem::path& folder);

}  // namespace tsdfpp
