// What a registration of a segment's points cannot see: whether the frame looks through places
// where the model, at the pose found, has a surface (docs/tracking.md, "Gates").
#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "mapper/track/distance_term.h"

namespace tsdfpp {

// A place on a model's surface, in its lattice's frame, metres; the normal points out of the
// object.
struct SurfacePlace {
  Eigen::Vector3f p_L = Eigen::Vector3f::Zero();
  Eigen::Vector3f normal_L = Eigen::Vector3f::Zero();
};

// Where the surface passes within kPlaceReach_voxels of an observed voxel, a place a voxel, in the
// grid's order of blocks. `reader` reads the same grid.
inline constexpr float kPlaceReach_voxels = 0.6F;
std::vector<SurfacePlace> PlacesOf(const TsdfGrid& grid, const SurfaceReader& reader,
                                   double voxel_m);

// What a frame says of a model's places that face its camera.
struct FreeSpaceCounts {
  int on = 0;        // something is seen as far away, to `margin_m`
  int in_front = 0;  // whatever is seen around it is farther away by more than `margin_m`

  double Share() const { return on + in_front == 0 ? 0 : double(in_front) / (on + in_front); }
};

// Around a place are the pixels within half a voxel's width of it, so that an outline may be off by
// as much. Places behind what is seen, beyond the image, or with a pixel without valid depth among
// those around them count as neither. Thinned evenly to at most `max_places`.
FreeSpaceCounts CountInFront(const std::vector<SurfacePlace>& places, const Pose& T_LC,
                             const cv::Mat& depth, const Intrinsics& camera, double voxel_m,
                             double margin_m, int max_places);

}  // namespace tsdfpp
