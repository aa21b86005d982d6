// One [[object]] of a scene file.
#pragma once

#include <toml++/toml.h>

#include <filesystem>
#include <string>

#include "core/error.h"
#include "sim/config/scene_config.h"

namespace tsdfpp {

// Reads one object, checked against the scene so far: its frames, its room, its other objects.
// Errors: kUsage, with file, line and key.
Expected<SceneObject> ReadSceneObject(const toml::table& table, const std::string& where,
                                      const std::string& path, const SceneFolder& folder,
                                      const SceneConfig& so_far);

toml::table SceneObjectToToml(const SceneObject& object);

}  // namespace tsdfpp
