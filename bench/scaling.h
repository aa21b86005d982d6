// The measurements behind docs/scaling.md: how cost and memory grow, or do not. Tables as CSV;
// scripts/scaling_figures.sh runs them, draws the plots and fills the page.
#pragma once

#include <string>
#include <vector>

#include "core/error.h"

namespace tsdfpp {

struct ScalingOptions {
  std::string out = "out/scaling";
  std::vector<std::string> parts{"ids", "poses", "threads", "surface", "frames"};
  int frames = 10000;  // of the long runs, a multiple of kLongRunUnit
  int runs = 5;        // of what is measured over and over
};
inline constexpr int kLongRunUnit = 1000;  // frames: tenths that all show the same

// Also writes machine.csv, by parts: the processor, its cores and what else it had to do. Errors:
// kUsage for an unknown part or a number of frames that is no multiple, else those of the scenes
// and the renderer, kEnvironment where `out` cannot be written.
Expected<void> RunScaling(const ScalingOptions& options);

// Each writes its tables. Scenes are scenes/toycar3.toml and, with nothing moving,
// scenes/static.toml; settings are the defaults with profile `paper`.
//
// frames.csv: small images of the scene there and back, again and again, for `frames` frames: the
// time of a frame, blocks and memory, by tenths of the run. frames_summary.csv: the last tenth
// beside the first one.
Expected<void> MeasureLongRuns(const ScalingOptions& options);
// surface.csv: the time of a frame over the surface that it shows, as a window in the images grows.
Expected<void> MeasureSurface(const ScalingOptions& options);
// threads.csv: the steps of a frame with one thread and with two. spread.csv: medians, p99 and the
// worst of the frames, all steps together, of the best run.
Expected<void> MeasureThreads(const ScalingOptions& options);
// poses.csv: setting the pose of a moving car, values resampled or the index alone moved.
Expected<void> MeasurePoses(const ScalingOptions& options);
// ids.csv: rays through the same geometry under more and more ids (bench/ray_ids.h).
Expected<void> MeasureIds(const ScalingOptions& options);

}  // namespace tsdfpp
