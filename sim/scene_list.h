// The scene files of a folder, for lists.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/error.h"

namespace tsdfpp {

struct SceneFile {
  std::filesystem::path path;
  std::string name;
  std::string purpose;
  int frames = 0;
  double rate_hz = 0;
  int width = 0;
  int height = 0;
  bool random = false;  // drawn with --seed
};

// Every *.toml of `folder`, ordered by file name; each is read whole, so what is listed can be
// opened. Errors: kUsage where the folder is missing; those of LoadSceneConfig and ReadRandomScene.
Expected<std::vector<SceneFile>> SceneFiles(const std::filesystem::path& folder);

}  // namespace tsdfpp
