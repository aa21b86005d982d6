// Mapping beside Open3D on the same frames in the same run.
#pragma once

#include "core/error.h"

namespace tsdfpp {

struct SideBySideOptions {
  std::string scene = "scenes/toycar3.toml";
  std::string profile = "paper";
  int frames = 256;  // from the first on
  int warm_up = 16;  // frames mapped but not counted
  std::vector<int> threads{2};
};

// Prints, for each number of threads, the median milliseconds a frame of pose update and fusion
// (given poses) of each method and of Open3D's ScalableTSDFVolume with colour, and the ratios,
// frame by frame in turn. Errors: those of the source.
Expected<void> RunSideBySide(const SideBySideOptions& options);

}  // namespace tsdfpp
