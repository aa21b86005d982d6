// What each term of the tracker does for shapes that leave motions free.
#pragma once

#include <string>
#include <vector>

#include "core/error.h"

namespace tsdfpp {

struct TermsBenchOptions {
  std::vector<std::string> shapes;  // some of them; empty for all
  std::vector<std::string> sets;    // of terms; empty for all
  int seeds = 3;                    // draws of the noise
  std::string method = "tsdf++/anchored";
  std::string out;
};

// One object on a table, before a camera that stands still: it slides to the side, turns on the
// spot, and goes back turning. A box, a cylinder, a ball, a mug and a car, each in plain paint and
// with a pattern; true masks; depth exact or with a Kinect's noise and levels of colour with
// theirs. Tracked with the distances alone, with free space, outline, colour and the expected
// motion added one by one, and with others (docs/tracking.md). Writes terms.csv, a row for each
// shape, paint, depth and set: shifts (ATE), turns, ADD-S, how many directions are free,
// frozen frames and milliseconds, of draws the median; and summary.csv, a row a shape, paint and
// depth, with shifts and turns of all sets. Errors: kUsage for an unknown shape, set or method;
// else those of the scenes and the renderer.
Expected<void> RunTermsBench(const TermsBenchOptions& options);

}  // namespace tsdfpp
