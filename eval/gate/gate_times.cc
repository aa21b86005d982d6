#include "eval/gate/gate_times.h"

#include "metrics/statistics.h"

namespace tsdfpp {

bool WereTimedTogether(const CellResult& ours, const CellResult& theirs) {
  return !ours.timed_in.empty() && ours.timed_in == theirs.timed_in;
}

std::map<int, double> FrameTimeRatios(const CellResult& ours, const CellResult& theirs) {
  std::map<int, double> ratios;
  if (!WereTimedTogether(ours, theirs)) return ratios;
  std::size_t i = 0;
  for (const auto& [frame, digest] : ours.image_digests) {
    const double mine = i < ours.frame_ms.size() ? ours.frame_ms[i] : 0;
    const double other = i < theirs.frame_ms.size() ? theirs.frame_ms[i] : 0;
    if (mine > 0 && other > 0) ratios[frame] = mine / other;
    ++i;
  }
  return ratios;
}

Measured TimeRatio(const CellResult& ours, const CellResult& theirs) {
  if (!WereTimedTogether(ours, theirs)) {
    return Measured::Undefined("the two were not timed in one run");
  }
  std::vector<double> ratios;
  for (const auto& [frame, ratio] : FrameTimeRatios(ours, theirs)) ratios.push_back(ratio);
  return ratios.empty() ? Measured::Undefined("no frame was timed")
                        : Measured::Of(MedianOf(ratios));
}

}  // namespace tsdfpp
