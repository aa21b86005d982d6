// Which pixels of a frame a map can be expected to show (docs/metrics.md, `sane` and `seam`). All
// images are CV_8UC1, 255 or 0.
#pragma once

#include <deque>

#include "core/types.h"

namespace tsdfpp {

// Where neighbouring pixels do not show the same surface: they differ in id (an *outline*), or,
// with the same id, in depth by more than two voxels after the slope that the neighbour on the
// other side shows (a *step*).
enum class Edges { kAll, kOutlines, kBackgroundSteps };

// The pixels within max(2, ceil(1.5 f voxel / z)) of an edge, by rows and columns; z is the depth,
// in metres, of each of the edge's two pixels, so the nearer side's radius counts.
cv::Mat EdgeBorder(const Frame& frame, double voxel_m, Edges edges = Edges::kAll);

// The pixels of the last frame in `recent` with a valid depth whose surface point was also seen
// (depth within one voxel, same id; objects moved by their poses) by each of the frames before.
cv::Mat SeenByAll(const std::deque<Frame>& recent, double voxel_m);

// The cosine of the steepest incidence at which a sample of the truth counts as seen: steeper
// pixels are asked of no map.
double LeastSeenCosine();

}  // namespace tsdfpp
