#include "mapper/segment/no_masks.h"

namespace tsdfpp {

Expected<cv::Mat> NoMasks::Segment(const Frame& frame) {
  return cv::Mat(frame.depth.size(), CV_16UC1, cv::Scalar(kBackground));
}

}  // namespace tsdfpp
