// Times that gates compare: ratios of mappers that took turns on the same frames (docs/gates.md).
#pragma once

#include <map>
#include <string>
#include <utility>
#include <vector>

#include "eval/sweep/cell.h"
#include "metrics/measured.h"

namespace tsdfpp {

// Fewer pairs of frames than this decide nothing about times: one stall of the machine would.
inline constexpr int kLeastTimedFrames = 20;

// ours / theirs of each frame that both mapped, by frame. Empty where they did not run together.
std::map<int, double> FrameTimeRatios(const CellResult& ours, const CellResult& theirs);

// The median of FrameTimeRatios, which a stall of the machine leaves as it is. Undefined where they
// did not run together, which is said.
Measured TimeRatio(const CellResult& ours, const CellResult& theirs);

// Whether the cells took turns, frame by frame, so that their times may be compared.
bool WereTimedTogether(const CellResult& ours, const CellResult& theirs);

}  // namespace tsdfpp
