// The tracker's terms beside the distances: free space, outline and colour (docs/tracking.md,
// "Terms of the image"). Each is switched on by its weight in SdfTrackConfig.
#pragma once

#include <memory>
#include <vector>

#include "mapper/track/point_term.h"
#include "mapper/track/sdf_track_config.h"
#include "mapper/track/segment_points.h"
#include "mapper/track/segment_view.h"
#include "mapper/track/surface_reader.h"

namespace tsdfpp {

// What a keyframe keeps for the terms of later frames, in its camera's frame, metres.
struct KeyView {
  std::vector<Eigen::Vector3d> rim_C;
  std::vector<Eigen::Vector3d> rim_side_C;  // of each, across its ray: away from the object
  std::vector<Eigen::Vector3d> patch_C;
  std::vector<double> patch_grey;  // of each
};

// Of a frame's segment and its points: rims where the outline's weight is not 0; where the colour's
// is not, those of the points about which grey values change.
KeyView KeyViewOf(const SegmentView& view, const std::vector<SegmentPoint>& points,
                  const Intrinsics& camera, const SdfTrackConfig& config);

// What terms of a segment of a frame are made of. `T_LC_key` is where the keyframe's camera was in
// the lattice. All of it must live as long as they do.
struct ViewTermParts {
  const Frame* frame = nullptr;
  const SegmentView* view = nullptr;  // of the frame; for outline and colour
  const KeyView* key = nullptr;       // may be none
  Pose T_LC_key = Pose::Identity();
  const TsdfGrid* model = nullptr;
  const SurfaceReader* reader = nullptr;  // of the model
  double voxel_m = 0;
};
// Free space and colour, those of them that have a weight and points.
std::vector<std::unique_ptr<PointTerm>> ViewTermsOf(const ViewTermParts& parts,
                                                    const SdfTrackConfig& config);

// The outline; null where it has no weight or no rim. A rim counts while the camera looks at it
// from no farther to its own side than the keyframe's did: from there something may be in sight
// that was behind it, which then makes the outline.
std::unique_ptr<PointTerm> OutlineTermOf(const ViewTermParts& parts, const SdfTrackConfig& config);

}  // namespace tsdfpp
