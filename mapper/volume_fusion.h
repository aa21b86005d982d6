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

inline constexpr int kItselfAround = 13;  // of the 27 blocks around one

// A block that the frame changed.
struct FusedBlock {
  InstanceId id = kNoInstance;
  Index3 index;
  TsdfBlock* block = nullptr;
  BlockMask votes{};  // voxels with an observation of this object in band
  // The 27 blocks around (bit 9 z + 3 y + x, this one in the middle) whose cover may have changed.
  std::uint32_t touched = 0;
  std::uint8_t sign_slices = 0;        // of FusionResult::changed_signs
  std::uint8_t band_slices = 0;        // with a voxel that is in the band anew, or no longer
  bool is_listed_with_others = false;  // of the block
};

// Allocates the blocks of the labels in the frame (making volumes for new labels), fuses, applies
// the contradiction rule if the config asks for it, and returns the blocks in which a voxel
// changed. Their masks are up to date but for `cover`.
std::vector<FusedBlock> FuseIntoVolumes(const FrameView& frame, const MapConfig& config,
                                        ObjectVolumes& volumes);

}  // namespace tsdfpp
