// What a depth image says of the surface at each pixel: its normal, where it jumps, where it is
// concave (docs/segmentation.md, "Maps"; after Furrer et al. 2018). All is computed from inverse
// depth, which on a plane is affine in the pixel.
#pragma once

#include "core/types.h"
#include "mapper/segment/depth_segments_config.h"
#include "mapper/segment/inverse_depth.h"
#include "mapper/segment/pixel_rays.h"

namespace tsdfpp {

struct SurfaceMaps {
  PixelRays rays;
  ChordReach reach;
  cv::Mat inverse_depth;  // CV_32FC1, 1/m, narrow holes bridged, smoothed; 0: nothing known
  cv::Mat depth;          // CV_32FC1, m: its inverse, 0 where nothing is known
  cv::Mat normal;         // CV_32FC3, camera frame, towards the camera; 0 where nothing is known
  cv::Mat sigma;          // CV_32FC1, m: of a single value of depth
  // CV_8UC1: how many pixels to the right, or down, can be walked from here without a jump, up to
  // 255. 0: there is a jump, or nothing, between this pixel and the next.
  cv::Mat reach_right;
  cv::Mat reach_down;
  cv::Mat concave;  // CV_8UC1: 255 where the surface is concave, else 0
};

// Computes the maps of one image after the other, and keeps their memory.
class SurfaceMapper {
 public:
  // `depth` as Frame::depth, of the intrinsics' size; the config must be valid. The same for any
  // number of threads. What is returned lasts until the next call.
  const SurfaceMaps& Compute(const cv::Mat& depth, const Intrinsics& intrinsics,
                             const DepthSegmentsConfig& config);

 private:
  SurfaceMaps maps_;
  cv::Mat measured_;
  cv::Mat bridged_;
};

}  // namespace tsdfpp
