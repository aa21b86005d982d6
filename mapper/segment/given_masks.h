// Segments that came with the frame.
#pragma once

#include "mapper/segment/segmenter.h"

namespace tsdfpp {

// The only reader of Frame::mask in the mapper.
class GivenMasks : public Segmenter {
 public:
  // The mask itself. Errors: none; whoever goes on with an image that is missing, or of another
  // size or type, is refused by CheckFrameForm (mapper/map_reach.h).
  Expected<cv::Mat> Segment(const Frame& frame) override;
};

}  // namespace tsdfpp
