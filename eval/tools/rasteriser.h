// A mesh as a camera sees it, by z-buffer on the CPU: for the sanity of the visible scene and for
// pictures.
#pragma once

#include "core/types.h"

namespace tsdfpp {

struct Raster {
  cv::Mat depth;  // CV_32FC1, metres along the optical axis, 0 where nothing is hit
  cv::Mat face;   // CV_32SC1, index of the triangle, -1 where nothing is hit
};

// One sample at each pixel's centre (an integer). Both sides of a triangle are seen; triangles with
// a vertex less than 5 cm in front of the camera are left out; of equal depths the lower index
// wins. The result does not depend on the number of threads.
Raster Rasterise(const TriangleMesh& mesh_W, const Intrinsics& intrinsics, const Pose& T_WC);

}  // namespace tsdfpp
