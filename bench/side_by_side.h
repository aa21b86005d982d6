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
  int first = 20;   // frames of the sequence that are left out: toycar3's objects move from here on
  int frames = 24;  // mapped in a run
  int warm_up = 8;  // of these, the first ones, not counted
  int runs = 5;     // of everything
  std::vector<int> threads{1, 2};
  std::vector<std::string> methods{"tsdf/static", "tsdf",           "tsdf/guarded",
                                   "tsdf++",      "tsdf++/literal", "tsdf++/anchored",
                                   "volumes"};
  std::filesystem::path out;  // where given, the tables are written into this folder as well
};

// Prints what SideBySideTables say of each case: milliseconds a frame of each method, with given
// poses, beside those of integration with colour of Open3D's volumes on the same frames, with the
// same band on both sides of a surface. Two maps of each method are timed: one that colours its
// whole band, as Open3D does, with its pose updates ("equal work"), and one as shipped, fusion
// alone. Open3D runs in processes of its own (bench/peer_process.h), one with OpenMP threads that
// sleep while they wait and one with threads that spin. All take turns every kFramesInARow frames,
// and each run goes through all cases and numbers of threads. `out` gets CASE.md, summary.md and
// measured.md. Errors: those of the source; kUsage for names that there are not; kEnvironment where
// such a process fails or nothing can be written.
Expected<void> RunSideBySide(const SideBySideOptions& options);

// What such a process does: at each turn of its case and number of threads, the times of the next
// frames.
Expected<void> RunPeers(const SideBySideOptions& options);

}  // namespace tsdfpp
