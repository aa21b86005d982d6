// Rays through pixels, whose centres are at whole numbers, and back.
#pragma once

#include "core/types.h"

namespace tsdfpp {

// The ray of a pixel in the camera's frame, with z = 1: times its depth it is the pixel's point.
inline Eigen::Vector3d PixelRay(const Intrinsics& k, double u, double v) {
  return {(u - k.cx) / k.fx, (v - k.cy) / k.fy, 1.0};
}

// Where a point of the camera's frame is in the picture, in pixels; its z must not be 0.
inline Eigen::Vector2d PixelOf(const Intrinsics& k, const Eigen::Vector3d& p_C) {
  return {k.fx * p_C.x() / p_C.z() + k.cx, k.fy * p_C.y() / p_C.z() + k.cy};
}

}  // namespace tsdfpp
