// Where an object is of which nothing is known but its model and a segment that may be its.
#pragma once

#include <optional>
#include <vector>

#include "mapper/track/segment_points.h"
#include "mapper/volume/tsdf_block.h"

namespace tsdfpp {

// A segment and a model.
struct ModelSearch {
  const Frame* frame = nullptr;
  const std::vector<SegmentPoint>* points = nullptr;
  cv::Mat may_be;  // LookAtModel()'s: the segment
  const TsdfGrid* model = nullptr;
  Pose T_WL_last = Pose::Identity();  // where the model's lattice was last
  double voxel_m = 0;
};

// A segment of fewer points may be of anything.
inline constexpr std::size_t kLeastSearchedPoints = 100;

struct FoundModel {
  Pose T_LC = Pose::Identity();
  // What speaks for the place, at most 1, and for the best of the places that would look otherwise.
  double score = 0;
  double other_score = 0;
};

// The best of all places that were tried: around the model from all sides, and turned as it was
// last, registered (sdf_registration.h), first with few points, then those of the best scores with
// all. A place scores by the segment's points that lie on the model's surface and have its colour,
// against those that lie in what was seen to be free, or have another colour, and against surface
// voxels that the frame shows not to be there. Behind a surface nothing was seen: there the other
// side of a thin thing may be. Of places that look the same, as those of a box or a ball do, it is
// the one that the object has turned least to since it was last seen. Nothing where the segment has
// too few points or no place can be registered to. Costs some tens of milliseconds. Deterministic
// for any number of threads; `config` must be valid.
std::optional<FoundModel> FindModel(const ModelSearch& search, const SdfTrackConfig& config);

// Whether the best place may be taken for the right one: enough speaks for it, and clearly more
// than for any that would look otherwise.
bool IsCertain(const FoundModel& found);

}  // namespace tsdfpp
