// Which object of the map each segment is (paper III-C): the second verb of the pipeline.
#pragma once

#include "core/types.h"
#include "mapper/map_representation.h"

namespace tsdfpp {

class Associator {
 public:
  virtual ~Associator() = default;

  // The object of each pixel: CV_16UC1 like `segments`, which the segmenter made of the frame; ids
  // that the map does not have are of objects that the frame brings into it. May share its pixels
  // with `segments`.
  virtual cv::Mat Associate(const Frame& frame, const cv::Mat& segments,
                            const MapRepresentation& map) = 0;
};

}  // namespace tsdfpp
