// How well objects are tracked, scene by scene.
#pragma once

#include <string>
#include <vector>

#include "core/error.h"

namespace tsdfpp {

struct TrackBenchOptions {
  std::string scenes = "scenes";  // a folder of scenes
  std::vector<std::string> only;  // names of some of them; empty for all
  std::vector<std::string> depths = {"exact", "noise"};
  // Trackers, each with a method: "track tsdf++/anchored", which "track tsdf++/anchored keep" has
  // map pixels that bleed like others (BleedingPixels); and "known", which has no map.
  std::vector<std::string> runs = {"known", "track tsdf++/anchored", "track tsdf++"};
  int seeds = 1;         // draws of the noise: the scene's own seed and those that follow it
  std::string settings;  // a file of mapper/track/sdf_track_config.h; empty for the defaults
  std::string map;       // one of mapper/map_config.h, likewise
  int until = 100000;    // the last frame
  std::string out;
};

// Renders each scene once, and gives its true masks, and depth that is exact or has the noise of
// nguyen2012, drawn for each seed, to each run. `known` registers to the distances of the true
// surfaces, beginning at the true poses. Writes objects.csv, a row for each seed, run and object of
// which a point moves at least 5 cm; of these, a row a scene and depth, shifts.csv (ATE,
// millimetres) and turns.csv (rotation, degrees): the median over the objects, where there are
// seeds the median of it over these with the least and the largest in brackets, and the worst
// object of all seeds; uncertainty.csv, a row a depth and run: of how many objects the squared
// errors of the motions are as large as their covariances say (TrackScores::nees); and times.csv, a
// row a run: milliseconds an object and frame, medians. Errors: kUsage for an unknown scene, depth
// or run, or wrong settings; else those of the scenes and the renderer.
Expected<void> RunTrackBench(const TrackBenchOptions& options);

}  // namespace tsdfpp
