// Normals from inverse depth, and the noise that they let expect.
#pragma once

#include "mapper/segment/inverse_depth.h"
#include "mapper/segment/pixel_rays.h"

namespace tsdfpp {

// With a and b the slopes of inverse depth q along a row and a column at pixel (u, v), the normal
// of the plane that has them is, up to its length,
//   -(a fx, b fy, q - a (u - cx) - b (v - cy)),
// turned towards the camera. A slope is the mean of those to either side over s pixels (as far as
// there are values) where they agree to noise and one pixel's width; else the one nearer to 0: so
// at an edge the normal is that of one side. `sigma` is the noise along the ray at that depth and
// angle, and, as on a slope depth is off where its pixel is, the noise across it times the slope of
// depth, in quadrature. Both images get zeros where q is 0.
void ComputeNormals(const PixelRays& rays, const ChordReach& reach,
                    const DepthSegmentsConfig& config, const cv::Mat& inverse, cv::Mat& normal,
                    cv::Mat& sigma);

}  // namespace tsdfpp
