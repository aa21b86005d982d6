// Is there surface near a sample that faces the way the sample does?
#pragma once

#include <numbers>
#include <span>
#include <vector>

#include "metrics/surface_index.h"

namespace tsdfpp {

// A sample counts as reconstructed only where the surface's normal is within 60 deg of the truth's
// (docs/sources.md, "Reconstructed samples"): a parallel sheet facing the other way does not count.
inline constexpr double kMaxNormalAngle_rad = std::numbers::pi / 3;

// Per sample, in the order of the samples.
struct SampleMatch {
  std::vector<float> nearest_m;   // to the nearest triangle, whichever way it faces
  std::vector<float> agreeing_m;  // to the nearest triangle whose normal agrees; infinite where
                                  // there is none within the limit
};

// Distance from each point to the surface, and to that part of it whose normal lies within
// `max_angle_rad` of the point's own. The nearest triangle alone would be unjust at sharp edges
// and thin walls: 1 mm from the edge of a box the nearest triangle of a good reconstruction
// often belongs to the other face, and on a wall thinner than the reconstruction's error to the
// other side. So where the nearest triangle disagrees, *every* triangle within `limit_m` is asked,
// exactly. A hole next to an edge is not filled by this: the face around the edge turns by more
// than 60 deg.
//
// `points` and unit `normals` in the surface's frame; `agreeing_m` is exact up to `limit_m`.
SampleMatch MatchSurface(std::span<const Eigen::Vector3f> points,
                         std::span<const Eigen::Vector3f> normals, const SurfaceIndex& surface,
                         double limit_m, double max_angle_rad = kMaxNormalAngle_rad);

}  // namespace tsdfpp
