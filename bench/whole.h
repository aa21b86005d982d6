// What a frame costs the whole system, segmentation and tracking included.
#pragma once

#include <string>
#include <vector>

#include "core/error.h"

namespace tsdfpp {

struct WholeBenchOptions {
  std::string scene = "scenes/toycar3.toml";
  // Images that many times the scene's size.
  std::vector<double> scales{1, 2.0 / 3};
  // Some of: given, depth, full, beside, live.
  std::vector<std::string> settings{"given", "depth", "full", "beside", "live"};
  std::vector<double> rates{15, 30};  // of `live`, frames a second, by scale
  int every = 5;                      // of `beside` and `live`: the network sees every n-th frame
  int first = 20;                     // frames of the sequence that are left out
  int frames = 200;                   // mapped
  int warm_up = 20;                   // of these, the first ones, not counted
  int runs = 3;     // of Open3D and all settings, in turn; figures are medians over them
  int threads = 2;  // of the mapper and of Open3D; the network's own of the last two is one more
  std::string out;  // where given, the table is written into this folder as well
};

// Prints milliseconds a frame of the pipeline (`tsdf++/anchored`, objects tracked by `track`), by
// step, and of all steps, on a scene's frames with the noise of nguyen2012 and of colours, which
// are in memory before it begins, with the camera's true poses; beside them those of integration
// with colour of the fastest of Open3D's volumes on the same frames, with a band as wide. As
// shipped: ours has 10 voxels in front of a surface and 3 behind it, Open3D 6.5 and 6.5, and ours
// colours two voxels beside the surface, Open3D the whole band. Settings: `given` tracks the true
// masks' objects, `depth` segments of depth (`--track moving`), `full` what our own network finds
// in each frame, joined with depth, `beside` the same with the network on a thread of its own at
// every n-th frame, known as many frames later. These frames come as fast as they are mapped.
// Those of `live`, which is `beside` with a network that gives way (NetworkConfig), come at their
// rate, as from a camera: its milliseconds of all steps begin when a frame's time has come, though
// the one before may not be done. `out` gets whole.csv. Errors: those of the scene, the network and
// the pipeline; kUsage for a setting that there is not, too few frames, or not as many rates as
// scales; kEnvironment where `out` cannot be written.
Expected<void> RunWholeBench(const WholeBenchOptions& options);

}  // namespace tsdfpp
