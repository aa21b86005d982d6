// What a frame tells before its voxels are looked at: tiles of its images, and the blocks along the
// rays of its pixels (docs/map.md, "Allocation").
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "core/types.h"

namespace tsdfpp {

struct KernelFrame;

// What the pixels of a square of the image hold.
inline constexpr int kTile_px = 16;
struct Tile {
  float nearest = std::numeric_limits<float>::infinity();  // metres, of the valid depths
  float farthest = 0;
  bool has_invalid = false;                 // whether a depth is not valid
  std::uint16_t least_label = kNoInstance;  // of all pixels
  std::uint16_t greatest_label = 0;
};

// The tiles of row `row` of tiles, from left to right.
void SummariseTiles(const KernelFrame& frame, int row, Tile* tiles);

// Rays of the camera, each through a pixel: (x, y, 1) and the pixel's depth in metres.
inline constexpr std::size_t kRaysAtOnce = 64;
struct RayBatch {
  alignas(64) std::array<double, kRaysAtOnce> x{};
  alignas(64) std::array<double, kRaysAtOnce> y{};
  alignas(64) std::array<double, kRaysAtOnce> depth{};
  std::size_t count = 0;
};

// Where along its ray each is to be looked at: `points` ranges from `front` before the depth in
// steps of `step`, none farther than `back` behind it, which the last one reaches; metres.
struct RayPoints {
  double front = 0;
  double back = 0;
  double step = 0;
  std::size_t points = 0;
};

// The camera in a lattice of voxels.
struct CameraInLattice {
  std::array<std::array<double, 3>, 3> R_LC{};  // rows
  std::array<double, 3> origin{};               // voxels
  double inverse_voxel = 0;                     // 1 / m
};

// The blocks, as PackIndex() packs them, of the voxels nearest to the points of the rays that are
// not behind the camera: each at least once, though not for each of its points. Returns how many
// there are; whole vectors are written: `keys` has room for the points of the whole batch and
// kKeysPerStep more.
inline constexpr std::size_t kKeysPerStep = 8;
std::size_t BlocksAtPoints(const CameraInLattice& camera, const RayPoints& where,
                           const RayBatch& rays, std::uint64_t* keys);

// The specification of each, in plain C++: the same bytes (mapper/kernels.h).
namespace plain {
decltype(tsdfpp::SummariseTiles) SummariseTiles;
decltype(tsdfpp::BlocksAtPoints) BlocksAtPoints;
}  // namespace plain

}  // namespace tsdfpp
