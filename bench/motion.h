// Whether what moves becomes an object without any network, and what stands still does not.
#pragma once

#include <string>

#include "core/error.h"

namespace tsdfpp {

struct MotionBenchOptions {
  int cases = 100;  // in which a toy is pushed; as many besides in which nothing moves
  int first_seed = 2001;
  std::string depth = "noise";  // or "exact"
  std::string method = "tsdf++/anchored";
  std::string settings;  // a file of mapper/track/sdf_track_config.h; empty for the defaults
  std::string out;
};

// Maps each case (bench/return_scenes.h, "pushed" and "still") with segments of depth, votes, and
// tracker `track` for what moves (TrackChoice::kMoving). A toy that is pushed is found in the first
// frame of its motion in which at least half of its pixels with depth are of objects that are known
// to have moved and show mostly this toy. Writes cases.csv, a row a case: the frames from its first
// 2 cm of motion to that one (negative where it was found before), of how many objects the toy is
// made then, and how many objects are false: known to have moved, and mostly something that did
// not, or not yet. And motion.csv, the counts. Errors: kUsage for an unknown depth or method, or
// wrong settings; else those of the renderer.
Expected<void> RunMotionBench(const MotionBenchOptions& options);

}  // namespace tsdfpp
