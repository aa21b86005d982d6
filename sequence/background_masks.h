// A recording without masks, for those who map it: all of it is taken for background.
#pragma once

#include <memory>
#include <string>

#include "core/error.h"
#include "core/frame_source.h"

namespace tsdfpp {

struct MaskedSource {
  std::unique_ptr<FrameSource> source;
  std::string remark;  // that masks were made; empty where the sequence has them
};

// `source` as it is where its first frame has a mask, else one whose frames have masks that are
// kBackground throughout, of the depth image's size. Errors: those of reading the first frame; and
// in Read() kData where a frame has a mask after all.
Expected<MaskedSource> WithBackgroundMasks(std::unique_ptr<FrameSource> source);

}  // namespace tsdfpp
