// A vertical cut through a map, as a picture and as numbers.
#pragma once

#include <opencv2/core.hpp>

#include "mapper/map_representation.h"

namespace tsdfpp {

// The rectangle of the cut: upright, `along_W` horizontal, about `middle_W`. Metres.
struct SliceFrame {
  Eigen::Vector3d middle_W = Eigen::Vector3d::Zero();
  Eigen::Vector3d along_W = Eigen::Vector3d::UnitX();  // unit
  double width_m = 0.6;
  double height_m = 0.3;
  double pixel_m = 0.00125;
};

struct MapSlice {
  cv::Mat distance;  // CV_32FC1, metres, signed, of the visible surface; NaN where unknown
  cv::Mat id;        // CV_16UC1, whose surface that is; kNoInstance where unknown
  // CV_8UC3, red-green-blue: white unknown, an object's colour outside (paler with the distance)
  // and inside (darker), black where the distance is 0.
  cv::Mat picture;
};

// What MapQuery (mapper/map_query.h) answers at each pixel's middle. Errors: kUsage, a sentence,
// where the map has no voxels.
Expected<MapSlice> CutMap(const MapRepresentation& map, const SliceFrame& frame);

}  // namespace tsdfpp
