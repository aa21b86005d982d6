// Where a surface jumps, and where it is concave.
#pragma once

#include "mapper/segment/inverse_depth.h"
#include "mapper/segment/pixel_rays.h"

namespace tsdfpp {

// Between two neighbours in a row or column, with inverse depth q0, q1 and the slopes g0 over the s
// pixels before and g1 over the s pixels behind, there is a jump where q1 - q0 is farther than
//   (config.sigmas sqrt(2) sigma / sqrt((2 m + 1) (m + 1)) + config.jump_px w z) / z^2
// from both g0 and g1: neither side goes on as the other. z is the nearer depth, sigma its noise, w
// z a pixel's width there, (2 m + 1) (m + 1) what half the mean's window holds. A slope across
// which there is no value is the other one; where there is neither, both are within +-kSteepest
// w z / z^2. Beside a pixel without value there is always a jump. `reach_right` and `reach_down`:
// SurfaceMaps.
void FindJumps(const PixelRays& rays, const ChordReach& reach, const DepthSegmentsConfig& config,
               const cv::Mat& inverse, const cv::Mat& sigma, cv::Mat& reach_right,
               cv::Mat& reach_down);

// A pixel is concave where a chord along its row or its column, from the point s pixels before over
// its own to the one s pixels behind, turns towards the camera by an angle whose tangent is above
//   tan(config.concave_deg) + config.sigmas sqrt(6) sigma / (2 m + 1) s w z / h^2,
// h the shorter half's length; a chord that jumps does not count.
void FindConcave(const PixelRays& rays, const ChordReach& reach, const DepthSegmentsConfig& config,
                 const cv::Mat& depth, const cv::Mat& sigma, const cv::Mat& reach_right,
                 const cv::Mat& reach_down, cv::Mat& concave);

}  // namespace tsdfpp
