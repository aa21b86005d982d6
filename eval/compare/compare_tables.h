// The tables of a comparison, as text (docs/metrics.md explains the columns).
#pragma once

#include <string>
#include <vector>

#include "eval/compare/compare.h"

namespace tsdfpp {

// The evaluation that tables show: that of the reveal frame, else the last one.
const Evaluation& Examined(const CompareResult& result, const std::vector<Evaluation>& evaluations);
const Evaluation& Examined(const CompareResult& result, const CompareRun& run);

// The map's size at that frame.
const MapMemory& ExaminedMemory(const CompareResult& result, const CompareRun& run);

// "open3d", or "open3d (any label)" where it tells no objects apart. It must have evaluations.
std::string TitleOf(const AdapterRun& run);

enum class Times { kShown, kLeftOut };

// Every column of every map and adapter; titles first, "-" where a value is undefined.
std::vector<std::vector<std::string>> TableRows(const CompareResult& result, Times times);

// A sentence for each map that failed, and one where the frames ended early.
std::vector<std::string> FailureLines(const CompareResult& result);

// A line an adapter: what it cost, or why it failed; and its remarks.
std::vector<std::string> AdapterLines(const CompareResult& result);

// The main figures: a row a method, the truncation profiles side by side, and a blank line.
// Adapters are not in it; nothing where there is nobody else.
std::string FrontTable(const CompareResult& result);

// TableRows; and AdapterLines, which say what an adapter took, where times are shown. Without times
// the same maps of the same frames have the same text.
std::string SummaryTable(const CompareResult& result, Times times = Times::kShown);

}  // namespace tsdfpp
