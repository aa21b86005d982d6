#include "sim/scene_list.h"

#include <algorithm>
#include <system_error>

#include "core/folders.h"
#include "core/toml_reader.h"
#include "sim/config/scene_config.h"
#include "sim/load_scene.h"
#include "sim/motion/random_scene.h"

namespace tsdfpp {
namespace {

template <typename Config>
SceneFile Describe(const std::filesystem::path& path, const Config& config, bool random) {
  return {path,
          config.name,
          config.purpose,
          config.frames,
          config.rate_hz,
          config.intrinsics.width,
          config.intrinsics.height,
          random};
}

}  // namespace

Expected<std::vector<SceneFile>> SceneFiles(const std::filesystem::path& folder) {
  std::vector<std::filesystem::path> paths;
  for (const std::filesystem::path& entry : EntriesOf(folder)) {
    if (entry.extension() == ".toml") paths.push_back(entry);
  }
  if (paths.empty()) {
    return UsageError("{}: {}, expected a folder with scenes", folder.string(),
                      !IsThere(folder)    ? "no such folder"
                      : !IsFolder(folder) ? "is a file"
                                          : "holds no .toml file");
  }
  std::vector<SceneFile> files;
  for (const std::filesystem::path& path : paths) {
    TSDFPP_ASSIGN(const toml::table root, ParseTomlFile(path));
    if (IsRandomScene(root)) {
      TSDFPP_ASSIGN(const RandomSceneConfig config, ReadRandomScene(root, path.string()));
      files.push_back(Describe(path, config, true));
    } else {
      TSDFPP_ASSIGN(const SceneConfig config, LoadSceneConfig(path));
      files.push_back(Describe(path, config, false));
    }
  }
  return files;
}

}  // namespace tsdfpp
