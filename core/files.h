// Files appear whole (temporary name, then rename) or not at all.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "core/error.h"
#include "core/limits.h"

namespace tsdfpp {

// A regular file's bytes; links are followed. Nothing is opened that is not a regular file, so no
// pipe is waited for and no device read. Errors: kData where the file is missing, unreadable, of
// another kind, or larger than the limit, which is looked at before anything is read.
Expected<std::string> ReadFile(const std::filesystem::path& path,
                               Limit limit = &Limits::file_bytes);

// For those who open the file themselves. Errors: kData where it is missing or no regular file.
Expected<void> CheckRegularFile(const std::filesystem::path& path);

// Makes the parent folders. Errors: kEnvironment where the disk refuses.
Expected<void> WriteFile(const std::filesystem::path& path, std::string_view bytes);

// Makes the folder and proves that it can be written to. Errors: kEnvironment.
Expected<void> MakeWritableFolder(const std::filesystem::path& path);

}  // namespace tsdfpp
