// A page that shows every scene of a folder: what it is for, and pictures of it.
#pragma once

#include <filesystem>
#include <functional>
#include <string>

#include "core/error.h"

namespace tsdfpp {

// Renders three frames (at 12, 50 and 88 % of the sequence, by the file's own seed) of every scene
// in `scenes` and writes `out`/scenes.md with a row a scene, `out`/pictures/scenes/<name>.jpg and
// `out`/pictures/scenes.jpg, a sheet of all; each file whole or not at all. `progress` is called
// with the number of scenes done and of all. Errors: those of SceneFiles and SimulatedSource;
// kUsage where two scenes have one name, or the page's place is somebody else's or a link;
// kEnvironment where a file cannot be written.
Expected<void> WriteScenePage(const std::filesystem::path& scenes, const std::filesystem::path& out,
                              const std::function<void(int, int)>& progress);

}  // namespace tsdfpp
