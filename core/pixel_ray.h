// Rays through pixels, whose centres are at whole numbers.
#pragma once

#include "core/types.h"

namespace tsdfpp {

// The ray of a pixel in the camera's frame, with z = 1: times its depth it is the pixel's point.
inline Eigen::Vector3d PixelRay(const Intrinsics& k, double u, double v) {
  return {(u - k.cx) / k.fx, (v - k.cy) / k.fy, 1.0};
}

}  // namespace tsdfpp
