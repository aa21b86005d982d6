// What a rendered frame costs, and on what: drawing, reading back, encoding, writing.
#pragma once

#include <string>

#include "core/error.h"

namespace tsdfpp {

struct RenderBenchOptions {
  std::string scene = "scenes/toycar3.toml";
  int frames = 20;  // spread over the scene
  int repeats = 3;  // of each; the fastest counts
  int jobs = 2;     // processes of the rate
};

// Prints the renderer's name and, for colour with and without antialiasing and for depth and masks
// alone, milliseconds a frame of CPU time and of wall clock by step in one process, the median over
// the frames of the fastest repeat, and the frames a second of wall clock of `jobs` processes side
// by side. Errors: those of opening and rendering the scene.
Expected<void> RunRenderBench(const RenderBenchOptions& options);

}  // namespace tsdfpp
