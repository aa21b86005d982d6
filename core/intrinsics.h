// Intrinsics of images of another size.
#pragma once

#include "core/types.h"

namespace tsdfpp {

// The same view in images `scale` times the size, to whole pixels.
inline Intrinsics Scaled(const Intrinsics& k, double scale) {
  if (scale == 1) return k;
  Intrinsics scaled = k;
  scaled.width = static_cast<int>(k.width * scale + 0.5);
  scaled.height = static_cast<int>(k.height * scale + 0.5);
  scaled.fx = k.fx * scale;
  scaled.fy = k.fy * scale;
  // Pixel centres are integers, so the image's edge is at -1/2.
  scaled.cx = (k.cx + 0.5) * scale - 0.5;
  scaled.cy = (k.cy + 0.5) * scale - 0.5;
  return scaled;
}

}  // namespace tsdfpp
