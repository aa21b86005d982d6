// The pixels of one segment that a tracker may go by, as points of the camera's frame.
#pragma once

#include <map>
#include <opencv2/core.hpp>
#include <vector>

#include "core/types.h"
#include "mapper/track/sdf_track_config.h"

namespace tsdfpp {

// The least rectangle around each label's pixels; `labels` is CV_16UC1. kNoInstance is left out.
std::map<InstanceId, cv::Rect> BoxesOf(const cv::Mat& labels);

struct SegmentPoint {
  Eigen::Vector3f p_C = Eigen::Vector3f::Zero();  // metres
  cv::Point2i pixel;
};

// The points of the pixels in `box` that are labelled `id` and have valid depth, unless a pixel
// within `mask_erosion_px` rows and columns has another label, or one of the four beside has no
// valid depth or one that differs by more than `max_step_voxels` (pixels beyond the image are not
// looked at). Of more than `max_points`, those at even steps in row order.
std::vector<SegmentPoint> SegmentPointsOf(const Frame& frame, const cv::Mat& labels, InstanceId id,
                                          const cv::Rect& box, double voxel_m,
                                          const SdfTrackConfig& config);

}  // namespace tsdfpp
