#include "sim/scene_list.h"

#include <algorithm>
#include <system_error>

#include "core/toml_reader.h"
#include "sim/random_scene.h"
#include "sim/scene_config.h"

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
  std::error_code status;
  std::vector<std::filesystem::path> paths;
  for (const auto& entry : std::filesystem::directory_iterator(folder, status)) {
    if (entry.path().extension() == ".toml") paths.push_back(entry.path());
  }
  if (status || paths.empty()) {
    return UsageError("{}: {}, expected a folder with scenes", folder.string(),
                      !std::filesystem::exists(folder, status)         ? "no such folder"
                      : !std::filesystem::is_directory(folder, status) ? "is a file"
                                                                       : "holds no .toml file");
  }
  std::sort(paths.begin(), paths.end());
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
