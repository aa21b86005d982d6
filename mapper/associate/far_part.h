// What a mask says is part of an object, and cannot be: masks merge what only touches in the
// picture.
#pragma once

#include <span>
#include <vector>

#include "core/types.h"
#include "mapper/associate/object_lookup.h"

namespace tsdfpp {

// How far from what is known of an object a part of its segment is not of it: from the box around
// its surface, along its lattice's axes.
struct FarPartConfig {
  double share = 0;      // of the box's diagonal, and at least
  double least_m = 0;    // metres
  double step_m = 0.04;  // a step in depth between neighbouring pixels that parts two surfaces
  // Of a part that may be the object's nevertheless, where something hides what is between.
  int least_pixels = 50;
};

// Of a segment's pixels (by rows, with valid depth; `ids` has the frame's segments) those, by rows,
// of the parts that are far from the object that the segment joins, of which `known` is the box
// around what the map has; none where that is empty. A part is what steps in depth leave connected.
// It is far where nearly all of its points are outside of the box, grown by as much as `config`
// says.
//   A part of an object that was not seen before may be far from what was, if something else hides
// what is between. So a part of least_pixels is not far if it comes to the picture's edge, or has a
// tenth of its outline beside something nearer that is not of the segment.
std::vector<int> FindFarPart(const Frame& frame, const cv::Mat& ids, std::span<const int> pixels,
                             const ObjectLookup::SurfaceBox& known, const FarPartConfig& config);

}  // namespace tsdfpp
