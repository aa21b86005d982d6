// Poses that came with the frame.
#pragma once

#include "mapper/track/tracker.h"

namespace tsdfpp {

// The only reader of Frame::T_WO in the mapper.
class GivenPoses : public Tracker {
 public:
  // The frame's poses; of objects of which it says nothing, those before it.
  TrackedPoses Track(const Frame& frame, const cv::Mat& labels, const MapRepresentation& map,
                     const ObjectPoses& before) override;
};

}  // namespace tsdfpp
