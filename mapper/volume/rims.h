// Cubes that are cut by the outline of a mask: their corners beyond it (docs/map.md, "Rims").
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "mapper/volume/volume_fusion.h"

namespace tsdfpp {

// Where the values of an object are.
struct RimVolume {
  const TsdfGrid* grid = nullptr;
  Pose T_WL = Pose::Identity();
  bool lattice_is_world = true;
};
// Nothing where the object has no volume. Is asked from several threads.
using RimVolumeOf = std::function<std::optional<RimVolume>(InstanceId)>;
// Whether an observed voxel of the grid is the object's; empty where all are. Is asked from several
// threads.
using IsOwnVoxel = std::function<bool(InstanceId, const Index3&)>;

// An unobserved voxel and the distance to give to it.
struct RimValue {
  int place = 0;            // in its block
  std::uint32_t pixel = 0;  // the first that sees a cube of it, v * width + u
  float distance_m = 0;
};

// One object's in one block; in increasing order of voxels.
struct RimBlock {
  InstanceId id = kNoInstance;
  Index3 index;
  std::vector<RimValue> voxels;
};

// The rims of the frame's masks, after it was fused; all by the values as they are now. In
// increasing order of ids.
std::vector<RimBlock> FindRims(const FrameView& frame, const MapConfig& config,
                               const RimVolumeOf& volume_of, const IsOwnVoxel& is_own);

// Writes one of them to a block; its masks are not updated.
void FuseRim(const FrameView& frame, const MapConfig& config, const RimValue& value,
             TsdfBlock& block);

// Completes the rims of the frame's masks, after it was fused; `fused`, what was changed by that,
// gets the blocks that this changes.
void FuseRims(const FrameView& frame, const MapConfig& config, ObjectVolumes& volumes,
              std::vector<FusedBlock>& fused);

}  // namespace tsdfpp
