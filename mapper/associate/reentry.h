// Whether a segment shows an object that was lost, and where that object then is: by shape and
// colour, from any direction.
#pragma once

#include <optional>
#include <vector>

#include "core/types.h"
#include "mapper/associate/reentry_config.h"
#include "mapper/map_representation.h"

namespace tsdfpp {

// A segment of a frame.
struct SeenSegment {
  std::vector<int> pixels;                // v * width + u, with valid depth, by rows
  std::vector<Eigen::Vector3d> points_W;  // of all of them, in their order
};

struct Reentry {
  // The object's motion since it was lost: T_WO(now) = T_now_lost * T_WO(lost).
  Pose T_now_lost = Pose::Identity();
  double on_surface = 0;  // share of the segment's points within a voxel of the surface
  double seen = 0;        // of the surface that should be seen, the share that is
  double colour = 0;      // mean difference of the points' colours, 0 to 1, less a common gain
  double Score() const { return on_surface * seen * (1 - colour); }
};

// Looks for the object `id` of the map, which was lost where it is there and can have moved
// `reach_m` since (between the middles of its surface and of the segment, its own size aside), in
// the segment: rotations all around, each with the shift that puts the part of the model that would
// face the camera onto the segment; the best of these are refined by Gauss-Newton on the signed
// distances of the segment's points (the tracker's term, points to the implicit surface), and the
// best one is verified against the frame: points lie on the surface, what of the surface should be
// seen is seen, colours agree. Nothing where no place passes config's limits. One-field maps, in
// which an object has no volume of its own, give nothing. Deterministic, one thread.
std::optional<Reentry> FindReentry(const MapRepresentation& map, InstanceId id, const Frame& frame,
                                   const SeenSegment& segment, double reach_m,
                                   const ReentryConfig& config);

}  // namespace tsdfpp
