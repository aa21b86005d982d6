// The user's own files that a scene is made of: meshes with their material libraries and pictures,
// pictures, a camera's trajectory.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "core/error.h"
#include "sim/config/scene_config.h"

namespace tsdfpp {

struct SceneInputs {
  // The scene with its files named as below, relative to the folder that holds inputs/.
  SceneConfig config;
  // Where each file lies now, by its place to be: "inputs/<number>/<path>". The number tells apart
  // files of one name; an OBJ's companions keep their places as seen from it.
  std::map<std::string, std::filesystem::path> files;
};

// The files themselves, with what of an OBJ's is read.
std::vector<std::filesystem::path> ListInputs(const SceneConfig& config);

// Numbers follow the order in which the scene names files (camera, then objects by id), so what was
// collected collects to the same again. A file that is named twice is there once. A companion that
// cannot be taken along (named by an absolute path, or in bytes that are not UTF-8) is left out
// with a warning; one that cannot be read is left out, since it was not drawn either.
// Errors: those of reading an OBJ (mesh_files.h).
Expected<SceneInputs> CollectInputs(const SceneConfig& config);

}  // namespace tsdfpp
