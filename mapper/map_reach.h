// The checks that keep out of a map what lies beyond its range (docs/map.md, "Range").
#pragma once

#include <map>

#include "core/error.h"
#include "mapper/map_representation.h"
#include "mapper/volume/tsdf_block.h"

namespace tsdfpp {

// Whether the frame is one at all: images of the camera's size and of the types that core/types.h
// states and two pixels a side at least, a camera with focal lengths, a rigid camera pose, a number
// of 0 or more. The mask is that which is given.
// Errors: kData, a sentence beginning with the frame's number. No pixel is looked at.
Expected<void> CheckFrameForm(const Frame& frame, const cv::Mat& labels);
// The same of what there is before segmentation: all but the mask.
Expected<void> CheckFrameForm(const Frame& frame);

// Whether the map can take these poses of objects and then this frame, whose form is right: the
// poses, what they move, the camera, and all that the frame's depth may show lie in the range.
// A map that is not made of blocks has no range; then poses have to be rigid, and they and what
// pixels can show at most kFarthest_m (core/farthest.h) away.
// Errors: kData, a sentence. Costs a few rays and boxes, and a look at the pixels only where the
// image's corners, as far away as depth is valid, do not all lie in the range.
Expected<void> CheckReach(const MapRepresentation& map, const Frame& frame, const cv::Mat& labels,
                          const std::map<InstanceId, Pose>& T_WO);

// The labels without those of pixels that CheckReach would refuse, which become kNoInstance.
cv::Mat WithoutBeyond(const MapRepresentation& map, const Frame& frame, const cv::Mat& labels);

// For Add(): the volume, where it is to be and the pose. Errors: kData, a sentence; kUsage where
// there is no pose, and the lattice is not the world's.
Expected<void> CheckAddition(const MapConfig& config, InstanceId id, const TsdfGrid& volume,
                             const Pose& T_WL, const std::optional<Pose>& T_WO);

// Aborts with the sentence where a frame that is about to be fused is refused by CheckFrameForm or
// CheckReach: who fuses into a map by himself asks first.
void RequireReach(const MapRepresentation& map, const Frame& frame, const cv::Mat& labels);

}  // namespace tsdfpp
