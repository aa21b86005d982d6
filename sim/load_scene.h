// A scene's file as a scene.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>

#include "core/error.h"
#include "sim/config/scene_config.h"

namespace tsdfpp {

// Reads a scene. Names of files in it are relative to its folder. A scene with a [random] section
// (random_scene.h) is drawn with `seed`, another takes `seed` for its own; without a seed the
// file's `seed` holds (1 where it has none). Errors: kUsage, with the file and line: not TOML, a
// key that is unknown, missing, of the wrong type or out of range, names or ids given twice, a
// model or a file that does not exist, a camera outside the room, a removed object that is not in
// the scene; those of DrawRandomScene; kData where a trajectory that the camera follows is
// unusable.
Expected<SceneConfig> LoadSceneConfig(const std::filesystem::path& path,
                                      std::optional<std::uint64_t> seed = std::nullopt,
                                      SceneOrigin origin = SceneOrigin::kUser);

}  // namespace tsdfpp
