// Fusion of a frame into object volumes, all objects in one pass (docs/map.md; paper III-F).
#pragma once

#include <map>
#include <vector>

#include "mapper/map_config.h"
#include "mapper/object_volume.h"
#include "mapper/observation.h"

namespace tsdfpp {

// Ordered, so that every walk over the objects is in increasing id.
using ObjectVolumes = std::map<InstanceId, ObjectVolume>;

// docs/map.md, "Fusion of an observation into a voxel"; distances in metres. `colour` is nullptr
// where the observation is clamped.
inline void FuseVoxel(TsdfBlock& block, std::size_t i, float distance, const std::int32_t* colour,
                      float weight_cap) {
  const float weight = block.weight[i];
  block.distance[i] = (weight * block.distance[i] + distance) / (weight + 1);
  block.weight[i] = std::min(weight + 1, weight_cap);
  if (colour == nullptr) return;
  const auto count = static_cast<float>(block.colour_count[i]);
  for (std::size_t channel = 0; channel < 3; ++channel) {
    const auto old = static_cast<float>(block.colour[channel][i]);
    const auto seen = static_cast<float>((*colour >> (8 * channel)) & 255);
    const float mean = old + (256.0F * seen - old) / (count + 1);
    block.colour[channel][i] = static_cast<std::uint16_t>(mean + 0.5F);
  }
  block.colour_count[i] = static_cast<std::uint16_t>(std::min(count + 1, weight_cap));
}

// A block that the frame changed.
struct FusedBlock {
  InstanceId id = kNoInstance;
  Index3 index;
  TsdfBlock* block = nullptr;
  BlockMask votes{};           // voxels with an observation of this object in band
  bool masks_changed = false;  // of observed, negative, band: only then can a cover change
};

// Allocates the blocks of the labels in the frame (making volumes for new labels), fuses, applies
// the contradiction rule if the config asks for it, and returns the blocks in which a voxel
// changed, by id, then index. Their masks are up to date but for `cover`.
std::vector<FusedBlock> FuseIntoVolumes(const FrameView& frame, const MapConfig& config,
                                        ObjectVolumes& volumes);

}  // namespace tsdfpp
