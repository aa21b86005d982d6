// Ray casting beside Open3D's VoxelBlockGrid on the same frames, and what more ids cost.
#pragma once

#include <string>

#include "core/error.h"

namespace tsdfpp {

struct RaysBenchOptions {
  std::string scene = "scenes/toycar3.toml";
  std::string profile = "paper";
  double open3d_band = 10;  // voxels on both sides of a surface
  int frames = 48;          // from the first on; mapped by all
  int every = 4;            // frames between casts
  int repeats = 5;          // of each cast; the fastest counts
  int threads = 2;
  double limit_s = 300;  // for Open3D's process
};

// Prints, for Open3D and for each method, medians over the casts: milliseconds for depth and normal
// (and id), wall clock and CPU, ratios, the median depth error against the frame's own depth; then
// the cost of the same visible geometry split into 1, 4, 16 and 64 ids. Errors: those of the
// source; where Open3D does not answer, its line says so and the others are printed.
Expected<void> RunRaysBench(const RaysBenchOptions& options);

}  // namespace tsdfpp
