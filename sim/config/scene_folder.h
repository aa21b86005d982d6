// Where the files lie that a scene names: meshes, pictures, trajectories.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "core/toml_reader.h"

namespace tsdfpp {

enum class SceneOrigin {
  kUser,  // somebody wrote it here: names lead wherever they say
  kData,  // it came with data: names lead to inputs/ beside it (scene_inputs.h) and nowhere else
};

class SceneFolder {
 public:
  // Names are relative to `folder`; to the working directory where it is empty.
  SceneFolder(std::filesystem::path folder, SceneOrigin origin = SceneOrigin::kUser)
      : folder_(std::move(folder)), origin_(origin) {}
  SceneFolder() : SceneFolder(std::filesystem::path()) {}

  // The file that `key` names. Nothing is opened. What is wrong becomes a fault of the reader, and
  // nothing is returned: there is no such file, or it lies where a scene of this origin must not
  // lead, links included.
  std::optional<std::filesystem::path> Find(TomlReader& reader, std::string_view key,
                                            const std::string& name) const;

 private:
  std::filesystem::path folder_;
  SceneOrigin origin_;
};

}  // namespace tsdfpp
