// What a surface metric cannot tell: the distance that it reads between equal surfaces.
#pragma once

#include <cstddef>

#include "core/types.h"
#include "metrics/measured.h"

namespace tsdfpp {

// Mean distance between a point and the nearest *other* one of the set: what a nearest-neighbour
// distance to this set reads, on average, for a point of the very surface that the set samples. For
// points spread at random with a density d it is 0.5 / sqrt(d). Metres. Undefined for fewer than
// two points.
Measured SamplingFloor_m(const TriangleMesh& points);

// Mean distance, by area, between a mesh's facets and the smooth surface that they stand for, were
// their vertices on it: what a distance to (or from) these facets reads for that surface. A facet
// whose corners have the normals n_i at p_i strays by sum over its edges of (n_j - n_i)(p_j - p_i)
// / 24 on average (the error of linear interpolation, to second order in the edges); n_i is the
// mean by area of the normals of the faces around the vertex that are within 45 deg of the facet's,
// so a crease is one, and flat faces give 0. Vertices at one place are one. Metres. Undefined
// without faces that have an area, and above kMostFacesForFloor (whose facets are too small to
// matter).
inline constexpr std::size_t kMostFacesForFloor = 3'000'000;
Measured TessellationFloor_m(const TriangleMesh& mesh);

// Half a unit in the last place of the largest coordinate, metres: positions are single precision.
double RoundingFloor_m(const TriangleMesh& mesh);

}  // namespace tsdfpp
