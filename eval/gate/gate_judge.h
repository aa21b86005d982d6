// A gate's verdict on the cells that were run for it (docs/gates.md).
#pragma once

#include <map>
#include <string>

#include "eval/gate/gate_config.h"
#include "eval/gate/gate_reference.h"
#include "eval/sweep/cell.h"

namespace tsdfpp {

// What a gate looks at, by replicate; `theirs` is null but for a paired gate.
struct GatePair {
  const CellResult* ours = nullptr;
  const CellResult* theirs = nullptr;
};
using GateData = std::map<std::string, GatePair>;

// Does it compare times?
bool IsOfTimes(const Gate& gate);

// The reference for an audit: replicates of `data` that it has not (fresh seeds) get the mean of
// those it has.
GateReference ReferenceOfFreshSeeds(GateReference reference, const GateData& data);

// The gate's verdict on its cells. `reference` may be null: then a gate that needs one is invalid,
// as it is where the reference lacks a replicate. Invalid where the metric is undefined for any
// replicate, or times are not of one run; inconclusive where fewer than kLeastTimedFrames frames
// were timed. The ratio of `frame_ms` is the median over the frames of a replicate, frame by frame.
Judgement JudgeGate(const Gate& gate, const GateData& data, const GateReference* reference,
                    const BootstrapConfig& statistics);

}  // namespace tsdfpp
