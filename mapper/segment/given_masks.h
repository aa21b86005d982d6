// Segments that came with the frame.
#pragma once

#include "mapper/segment/segmenter.h"

namespace tsdfpp {

// The only reader of Frame::mask in the mapper.
class GivenMasks : public Segmenter {
 public:
  // `objects` are what the masks' ids stand for; a segment has its object's class, the background
  // none.
  explicit GivenMasks(const std::vector<ObjectInfo>& objects = {});

  // The mask itself. Errors: none; whoever goes on with an image that is missing, or of another
  // size or type, is refused by CheckFrameForm (mapper/map_reach.h).
  Expected<Segments> Segment(const Frame& frame) override;

 private:
  std::map<InstanceId, std::string> classes_;
};

}  // namespace tsdfpp
