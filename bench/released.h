// What the authors' released configuration would change (docs/released.md): small scenes mapped
// with weights and distances in floating point, by the references of tests/reference/float_map.h.
#pragma once

#include <string>
#include <vector>

#include "core/error.h"

namespace tsdfpp {

struct ReleasedOptions {
  std::string out = "out/released";
  std::vector<std::string> scenes{"mini", "toycar3"};  // some of these
  std::vector<std::string> settings;                   // some of the tables' rows; empty for all
};

// Writes a table a scene, named for it, of the scores of `tsdf`, `tsdf/static` and `tsdf++` at the
// reveal by setting, and weights.csv, what the maps of that scene weigh.
// Errors: kUsage for an unknown scene or setting, else those of the scenes and the renderer,
// kEnvironment where `out` cannot be written.
Expected<void> RunReleased(const ReleasedOptions& options);

}  // namespace tsdfpp
