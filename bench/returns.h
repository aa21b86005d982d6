// Whether objects that go out of sight come back under their own ids.
#pragma once

#include <string>

#include "core/error.h"

namespace tsdfpp {

struct ReturnBenchOptions {
  int cases = 300;  // in which objects come back; a sixth as many besides are "replaced"
  int first_seed = 8001;
  std::string depth = "noise";  // or "exact"
  std::string method = "tsdf++/anchored";
  std::string settings;  // a file of mapper/track/sdf_track_config.h; empty for the defaults
  std::string out;
};

// Maps each case (bench/return_scenes.h) with true masks whose ids are drawn anew in every frame,
// association by votes and tracker `track`. Writes cases.csv, a row an object that comes back: what
// became of its id, which it has "right" in the last frame; in any frame after it came back it had
// another object's ("wrong"); else it has a "new" one, or "none". Also in how many frames it had
// its own again, how far off it is in the last (ADD-S, of its place as its motion since the first
// frames gives it), and the case's longest time of tracking in a frame. And returns.csv, a row a
// kind of case: the counts. Errors: kUsage for an unknown depth or method, or wrong settings; else
// those of the renderer.
Expected<void> RunReturnBench(const ReturnBenchOptions& options);

}  // namespace tsdfpp
