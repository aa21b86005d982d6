// The pixels that a surface covers, seen by itself.
#pragma once

#include <opencv2/core.hpp>

#include "core/types.h"

namespace tsdfpp {

// CV_8UC1: 255 where the ray through the pixel's centre meets a triangle in front of the camera
// (both sides count), 0 elsewhere. `T_CO` takes the mesh into the camera's frame.
cv::Mat Silhouette(const TriangleMesh& mesh_O, const Pose& T_CO, const Intrinsics& camera);

}  // namespace tsdfpp
