// One observation fused into one voxel (docs/map.md, "Fusion of an observation into a voxel"; paper
// III-F, "the standard weighted average scheme").
#pragma once

#include <algorithm>

#include "mapper/volume/tsdf_block.h"

namespace tsdfpp {

// docs/map.md, "Fusion of an observation into a voxel"; distances in metres. `colour` points at
// three bytes, or is nullptr where the observation has none to give.
inline void FuseVoxel(TsdfBlock& block, std::size_t i, float distance, const std::uint8_t* colour,
                      float weight_cap) {
  const auto weight = static_cast<float>(block.weight[i]);
  const float old_distance = block.distance[i];
  block.distance[i] = old_distance + (distance - old_distance) * (1 / (weight + 1));
  block.weight[i] = static_cast<std::uint8_t>(std::min(weight + 1, weight_cap));
  if (colour == nullptr) return;
  ColourSlice& colours = block.MakeColours(i / kSliceVoxels);
  const std::size_t k = i % kSliceVoxels;
  const auto count = static_cast<float>(colours.count[k]);
  const float share = 1 / (count + 1);
  for (std::size_t channel = 0; channel < 3; ++channel) {
    const auto old = static_cast<float>(colours.channel[channel][k]);
    const float mean = old + (256.0F * static_cast<float>(colour[channel]) - old) * share;
    colours.channel[channel][k] = static_cast<std::uint16_t>(mean + 0.5F);
  }
  colours.count[k] = static_cast<std::uint8_t>(std::min(count + 1, weight_cap));
}

}  // namespace tsdfpp
