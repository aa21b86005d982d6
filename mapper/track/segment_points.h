// The pixels of segments that a tracker may go by, and what they show as points of the camera's
// frame.
#pragma once

#include <map>
#include <opencv2/core.hpp>
#include <vector>

#include "core/types.h"
#include "mapper/track/sdf_track_config.h"

namespace tsdfpp {

// For each label but kBackground and kNoInstance, the pixels that remain when its mask is eroded by
// `erosion_px` (a square window; the image's own border erodes nothing), which may be none. By
// rows, each as its row times the image's columns plus its column. `labels` is CV_16UC1. The time
// grows with the image, whatever the number of labels.
std::map<InstanceId, std::vector<int>> PixelsByLabel(const cv::Mat& labels, int erosion_px);

// Axial deviations (SdfTrackConfig::Axial_m) that are neither a step of depth nor an outlier.
inline constexpr double kNoiseDeviations = 3;

struct SegmentPoint {
  Eigen::Vector3f p_C = Eigen::Vector3f::Zero();  // metres
  cv::Point2i pixel;
};

// The points of a segment's pixels (PixelsByLabel() with `mask_erosion_px`) that have valid depth,
// unless one of the four beside has no valid depth or one that differs by more than
// `max_step_voxels` and kNoiseDeviations (pixels beyond the image are not looked at). Of more than
// `max_points`, those at even steps in row order.
std::vector<SegmentPoint> SegmentPointsOf(const Frame& frame, const std::vector<int>& pixels,
                                          double voxel_m, const SdfTrackConfig& config);

}  // namespace tsdfpp
