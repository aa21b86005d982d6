// What is behind a gate's verdict: the replicate, the frame, the object, a picture (docs/gates.md).
#pragma once

#include <filesystem>
#include <string>

#include "eval/gate/gate_run.h"

namespace tsdfpp {

struct GateExplanation {
  std::string replicate;  // the one that is farthest out of the bounds, or nearest to them
  int frame = 0;          // the first evaluated one at which it is; else the examined one
  std::string object;     // the one that the metric is worst for; empty where it is of no object
  std::string sentence;   // all of this in words
  std::string picture;    // the file's name in `folder`; empty where there is none
};

// Maps the replicate again up to the frame and draws <gate>.png into `folder`: the camera, the map,
// the map after the removals, and the table from above. Where the gate could not be judged there is
// only a sentence. Call it after all RunGates: it renders in this process.
// Errors: those of rendering; kEnvironment where the picture cannot be written.
Expected<GateExplanation> ExplainGate(const GateRun& run, const GateOutcome& outcome,
                                      const References& references,
                                      const std::filesystem::path& folder);

// The part of it that needs no rendering: the replicate and the frame. `reference` may be null.
struct WorstPlace {
  std::string replicate;
  int frame = 0;
  std::string which;  // that frame is, in words: "the examined one"
};
WorstPlace FindWorst(const GateOutcome& outcome, const GateReference* reference);

}  // namespace tsdfpp
