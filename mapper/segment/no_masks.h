// What any RGB-D recording without masks gets: all of it is background.
#pragma once

#include "mapper/segment/segmenter.h"

namespace tsdfpp {

class NoMasks : public Segmenter {
 public:
  // kBackground at every pixel of the depth image. Errors: none.
  Expected<Segments> Segment(const Frame& frame) override;
};

}  // namespace tsdfpp
