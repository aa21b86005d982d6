// Mapping beside Open3D on the same frames.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/error.h"

namespace tsdfpp {

struct SideBySideOptions {
  std::string scene = "scenes/toycar3.toml";
  std::vector<std::string> cases{"1cm", "5mm", "2mm"};  // of SideBySideCases()
  int frames = 120;                                     // from the first on
  int warm_up = 10;                                     // frames mapped but not counted
  int runs = 1;                                         // of everything
  std::vector<int> threads{1, 2};
  std::vector<std::string> methods{"tsdf",           "tsdf/min",        "tsdf++",
                                   "tsdf++/literal", "tsdf++/anchored", "volumes"};
  std::filesystem::path page;  // where given, the tables are written there as well
};

// For each case: milliseconds a frame (median of all runs, 99th percentile and worst of the run
// with the least worst) of pose update and fusion of each method, with given poses, the median of
// fusion alone, and those of integration with colour of Open3D's two volumes, each for the numbers
// of threads; their ratio to the faster of Open3D's; and memory. Open3D runs in processes of its
// own (bench/peer_process.h), one with OpenMP threads that sleep while they wait and one with
// threads that spin; the faster counts. All take turns every kFramesInARow frames. Errors: those of
// the source; kUsage for names that there are not; kEnvironment where such a process fails.
Expected<void> RunSideBySide(const SideBySideOptions& options);

// What such a process does: at each turn of each case and number of threads, the times of the next
// frames.
Expected<void> RunPeers(const SideBySideOptions& options);

}  // namespace tsdfpp
