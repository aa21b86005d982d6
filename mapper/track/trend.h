// Whether an object that may be at rest goes one way.
#pragma once

#include <span>

#include "mapper/track/known_directions.h"

namespace tsdfpp {

// How sure it is that the places of an object in frames in a row, oldest first, go one way: the
// greatest ratio of a slope to its standard error (Student's t) along the `known` directions, each
// of a line through the places by least squares. Places are lengths of motions (MotionFrame) to one
// of them, metres. Left out are turns of which less than `weak_share` is known, and lines along
// which the places come no farther than `least_way_m` from the first frame to the last. 0 without
// others, or with fewer than three places.
double TrendOf(std::span<const Vector6> places, const KnownDirections& known, double weak_share,
               double least_way_m);

}  // namespace tsdfpp
