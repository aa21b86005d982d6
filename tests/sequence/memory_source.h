// A sequence made of noise, in memory: every pixel is different, every number awkward.
#pragma once

#include <functional>
#include <vector>

#include "core/frame_source.h"
#include "sequence/sequence_json.h"

namespace tsdfpp::test {

class MemorySource : public FrameSource {
 public:
  // `frames` frames of 13x7 pixels from number `first` on; objects background, "toy-truck" (1) and
  // "car" (2), which has no pose at its first frame.
  explicit MemorySource(int frames = 4, int first = 1);

  const SequenceInfo& info() const override { return info_; }
  Expected<Frame> Read(int index) override;
  Expected<std::vector<TrueModel>> Truth() override { return models_; }

  SequenceInfo info_;
  std::vector<TrueModel> models_;
  std::function<Expected<void>(Frame&)> on_read;  // may change or refuse a frame
};

GeneratorInfo SomeGenerator();

// Bit for bit.
void ExpectSame(const Frame& a, const Frame& b);
void ExpectSame(const SequenceInfo& a, const SequenceInfo& b);
void ExpectSame(const TrueModel& a, const TrueModel& b);

}  // namespace tsdfpp::test
