#include "sim/config/scene_folder.h"

#include <fmt/format.h>

#include <iterator>

#include "core/data_folder.h"
#include "core/one_line.h"
#include "sim/config/scene_readers.h"

namespace tsdfpp {
namespace {

// inputs/<number>/<path>: an OBJ may name what lies in the folder above its own.
bool IsInput(const std::filesystem::path& name) {
  return std::distance(name.begin(), name.end()) >= 3 && *name.begin() == "inputs";
}

}  // namespace

std::optional<std::filesystem::path> SceneFolder::Find(TomlReader& reader, std::string_view key,
                                                       const std::string& name) const {
  std::filesystem::path file = name;
  if (origin_ == SceneOrigin::kData) {
    const auto found = DataFolder(folder_).Find(name);
    if (!found || !IsInput(name)) {
      reader.Fault(key, fmt::format("is '{}', expected inputs/<number>/<file> beside the scene{}",
                                    OneLine(name), found ? "" : ": " + found.error().message));
      return std::nullopt;
    }
    file = *found;
  } else if (!folder_.empty()) {
    file = folder_ / file;
  }
  file = file.lexically_normal();
  std::error_code code;
  if (std::filesystem::is_regular_file(file, code)) return file;
  reader.Fault(
      key, fmt::format("names {}, {}", file.string(),
                       std::filesystem::is_directory(file, code) ? "which is a folder, not a file"
                                                                 : "which does not exist"));
  return std::nullopt;
}

}  // namespace tsdfpp
