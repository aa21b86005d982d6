#include "sim/load_scene.h"

#include "core/folders.h"
#include "core/toml_reader.h"
#include "sim/motion/random_scene.h"

namespace tsdfpp {

Expected<SceneConfig> LoadSceneConfig(const std::filesystem::path& path,
                                      std::optional<std::uint64_t> seed, SceneOrigin origin) {
  TSDFPP_ASSIGN(const toml::table root, ParseTomlFile(path));
  if (IsRandomScene(root)) {
    TSDFPP_ASSIGN(const RandomSceneConfig random, ReadRandomScene(root, path.string()));
    return DrawRandomScene(random, seed.value_or(random.seed));
  }
  return ReadSceneConfig(root, path.string(), {AbsolutePath(path).parent_path(), origin}, seed);
}

}  // namespace tsdfpp
