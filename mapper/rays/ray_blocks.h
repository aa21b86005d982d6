// What rays read of a map: for each block in view that holds a crossed cube, these cubes and the
// distances at their corners, so that a block is cast through without a look at its neighbours.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "mapper/volume/tsdf_block.h"

namespace tsdfpp {

// A volume under rays. The grid must outlive the cast.
struct RayVolume {
  InstanceId id = kNoInstance;
  const TsdfGrid* grid = nullptr;
  Pose T_WL = Pose::Identity();
  bool lattice_is_world = true;
};

// Corners along an axis of a block's cubes.
inline constexpr int kCorners = kBlockSide + 1;

struct CrossedCubes {
  std::array<std::uint8_t, 3> low{};   // the box that holds them, x, y, z
  std::array<std::uint8_t, 3> high{};  // one above
  // Two words a slice, the lower one first: bit 64 z + 8 y + x is set where the cube named by that
  // voxel is crossed.
  std::array<std::uint32_t, 16> bits{};
};

struct RayBlock {
  Index3 index;
  std::uint32_t volume = 0;  // its number among the volumes
  bool contested = false;    // whether a surface here may be hidden by what another object claims
  CrossedCubes cubes;
  std::array<float, kCorners * kCorners * kCorners> distance;  // metres, [z][y][x]
};

// The pixels that a block's crossed cubes cover at most, and the range of their depths (metres).
struct BlockFootprint {
  int u_low = 0;
  int u_high = -1;  // included; below u_low: out of view
  int v_low = 0;
  int v_high = -1;
  float near_m = 0;
};

// A camera before a lattice: T_CL as rows.
struct RayCamera {
  Intrinsics intrinsics;
  Pose T_WC = Pose::Identity();
};

struct RayBlocks {
  std::size_t size() const { return footprints.size(); }
  const RayBlock& operator[](std::size_t i) const { return blocks[i]; }

  std::unique_ptr<RayBlock[]> blocks;  // by volume, then in the order of its grid's index
  std::vector<BlockFootprint> footprints;
};

// The blocks of the volumes that the camera may see. `contested(volume, box in voxels of its
// lattice: low, high)` says whether another object may hide what is in that box; empty: never.
using ContestedBox = std::function<bool(const RayVolume&, const Index3&, const Index3&)>;
RayBlocks FindRayBlocks(const std::vector<RayVolume>& volumes, const RayCamera& camera,
                        double voxel_m, double near_m, const ContestedBox& contested);

}  // namespace tsdfpp
