// Angles at which the camera sees surfaces, from depth alone.
#pragma once

#include <opencv2/core.hpp>

#include "core/types.h"

namespace tsdfpp {

// The angle between each pixel's ray and its surface normal, radians in [0, pi/2], CV_32FC1; 0
// where depth is invalid. Along each image axis the tangent runs to that valid neighbour whose
// depth differs less, so that a surface's border has the surface's own normal; without one it is
// taken as parallel to the image. Exact on planes.
cv::Mat IncidenceAngles(const cv::Mat& depth, const Intrinsics& intrinsics);

}  // namespace tsdfpp
