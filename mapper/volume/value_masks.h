// The masks of a block that follow from its values alone.
#pragma once

#include "mapper/volume/tsdf_block.h"

namespace tsdfpp {

// See TsdfBlock.
struct ValueMasks {
  BlockMask observed;
  BlockMask negative;
  BlockMask band;
};

// `back` in metres.
ValueMasks MasksOfValues(const TsdfBlock& block, float back);

// The specification, in plain C++: the same bytes (mapper/kernels.h).
namespace plain {
decltype(tsdfpp::MasksOfValues) MasksOfValues;
}  // namespace plain

}  // namespace tsdfpp
