#include "mapper/segment/given_masks.h"

namespace tsdfpp {

Expected<cv::Mat> GivenMasks::Segment(const Frame& frame) { return frame.mask; }

}  // namespace tsdfpp
