#include "mapper/segment/no_masks.h"

namespace tsdfpp {

Expected<Segments> NoMasks::Segment(const Frame& frame) {
  return Segments{cv::Mat(frame.depth.size(), CV_16UC1, cv::Scalar(kBackground))};
}

}  // namespace tsdfpp
