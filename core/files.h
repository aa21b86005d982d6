// Files appear whole (temporary name, then rename) or not at all.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "core/error.h"

namespace tsdfpp {

// Errors: kData where the file is missing or unreadable.
Expected<std::string> ReadFile(const std::filesystem::path& path);

// Makes the parent folders. Errors: kEnvironment where the disk refuses.
Expected<void> WriteFile(const std::filesystem::path& path, std::string_view bytes);

// Makes the folder and proves that it can be written to. Errors: kEnvironment.
Expected<void> MakeWritableFolder(const std::filesystem::path& path);

}  // namespace tsdfpp
