// The measurements behind docs/map-figures.md: tables as CSV. scripts/map_figures.sh runs them,
// draws the plots and fills the page.
#pragma once

#include <string>
#include <vector>

#include "core/error.h"

namespace tsdfpp {

struct FigureOptions {
  std::string out = "out/map-figures";
  std::vector<std::string> parts{"decay", "layers", "switches", "sweep", "slice", "ghosts"};
};

// Errors: kUsage for an unknown part, else those of the scenes and the renderer, kEnvironment where
// `out` cannot be written.
Expected<void> RunFigures(const FigureOptions& options);

// Each writes its tables.
//
// decay.csv: the cars of scenes/toycar3.toml, fused while they stand still and then only moved by
// their true poses: what is left of them after each number of moves, by way of moving.
Expected<void> MeasureDecay(const FigureOptions& options);
// layers.csv: the pile of scenes/stack.toml (half-size images, every fourth frame) with three and
// with four surfaces at one place, and what of its hidden parts is left once the parts above are
// removed, by K.
Expected<void> MeasureLayers(const FigureOptions& options);
// switches.csv: scenes/mini.toml at its reveal, with each setting changed alone.
Expected<void> MeasureSwitches(const FigureOptions& options);
// sweep.csv: the same with the truncation behind surfaces from 2 to 10 voxels.
Expected<void> MeasureSweep(const FigureOptions& options);
// slice.csv: the voxels of a vertical slice through table and car of scenes/mini.toml, before,
// during and after the car's passage.
Expected<void> MeasureSlice(const FigureOptions& options);
// ghosts.csv: where the ghosts of scenes/mini.toml and scenes/toycar3.toml (half-size images) lie
// at the reveal, before and after the removal, and what the frames said of the space half a voxel
// under them.
Expected<void> MeasureGhosts(const FigureOptions& options);

}  // namespace tsdfpp
