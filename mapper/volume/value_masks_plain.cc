// The masks voxel by voxel.
#include "mapper/volume/value_masks.h"

namespace tsdfpp::plain {

ValueMasks MasksOfValues(const TsdfBlock& block, float back) {
  ValueMasks masks{};
  for (int i = 0; i < kBlockVoxels; ++i) {
    const float distance = block.distance[static_cast<std::size_t>(i)];
    if (block.weight[static_cast<std::size_t>(i)] == 0) continue;
    SetBit(masks.observed, i);
    if (!(distance < 0)) continue;
    SetBit(masks.negative, i);
    if (distance >= -back) SetBit(masks.band, i);
  }
  return masks;
}

}  // namespace tsdfpp::plain
