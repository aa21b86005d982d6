// A small world that can be computed by hand: a wall with two boxes before it, seen by a camera
// that moves and turns; depth and masks by casting rays on planes and boxes, models as meshes.
#pragma once

#include <vector>

#include "core/frame_source.h"

namespace tsdfpp::test {

class BoxSource : public FrameSource {
 public:
  // `frames` frames of 64x48 from number 0 on; background (the wall z = 1.5 m), "left" (3) and
  // "right" (8), which moves to the left by 1 cm a frame and passes before "left".
  explicit BoxSource(int frames = 6);

  const SequenceInfo& info() const override { return info_; }
  Expected<Frame> Read(int index) override;
  Expected<std::vector<TrueModel>> Truth() override;

  SequenceInfo info_;
};

}  // namespace tsdfpp::test
