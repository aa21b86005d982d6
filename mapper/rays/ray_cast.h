// Images of a map seen from any pose (docs/map.md, "Ray casting").
#pragma once

#include <vector>

#include "core/types.h"

namespace tsdfpp {

struct RayCastOptions {
  int surfaces = 1;     // how many surfaces along each ray, 1 or more
  bool colour = true;   // whether to fill RaySurface::colour
  double near_m = 0.0;  // surfaces at less depth are not seen; none is seen behind the camera

  // near_m, and 0 where it is below 0 or no number.
  double NearestDepth_m() const { return near_m > 0 ? near_m : 0; }
};

// One surface along each ray, an image a quantity; pixel centres are integers.
struct RaySurface {
  cv::Mat depth;   // CV_32FC1, metres along the optical axis; 0 where there is no surface
  cv::Mat normal;  // CV_32FC3, unit, outwards, in the world's frame; 0 where there is none
  cv::Mat colour;  // CV_8UC3, red-green-blue; black where there is none; empty unless asked for
  cv::Mat id;      // CV_16UC1, kNoInstance where there is none
};

}  // namespace tsdfpp
