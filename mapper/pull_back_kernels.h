// The arithmetic of reading one lattice at the voxels of a block of another (docs/map.md, "Lattice"
// and "Trilinear interpolation"), in loops that are compiled for several instruction sets.
#pragma once

#include <array>
#include <cstdint>

#include "mapper/tsdf_block.h"

namespace tsdfpp {

// A cube of voxels around a block that was pulled back: by a rigid motion a block's voxels span at
// most 14 lowest corners an axis (7 sqrt(3) < 13); one more corner on either side.
inline constexpr int kPatchSide = 16;
inline constexpr int kPatchVoxels = kPatchSide * kPatchSide * kPatchSide;
using PatchValues = std::array<float, kPatchVoxels>;  // x fastest, then y, then z

// A block's voxels as points of another lattice.
struct PulledPoints {
  Index3 low;   // voxel of the other lattice at the patch's place 0: one below the lowest corner
  Index3 high;  // the highest corner, included
  std::array<std::int32_t, kBlockVoxels> corner;  // place in the patch of the lowest of the eight
  std::array<std::array<float, kBlockVoxels>, 3> fraction;  // x, y, z
};

// The points (T * (h v)) / h of the block's voxels v; `T` holds the rows of a rigid 3x4 matrix, h
// is `voxel_m`.
void PullBackPoints(const std::array<double, 12>& T, double voxel_m, const Index3& first,
                    PulledPoints& points);

// Trilinear interpolation at the points that `wanted` marks (-1 or 0). Corners with a coefficient
// of zero do not count; `out` is NaN where a corner that counts is NaN.
void InterpolateCounted(const PatchValues& values, const PulledPoints& points,
                        const std::int32_t* wanted, float* out);

// The same where all eight corners count.
void InterpolateAll(const PatchValues& values, const PulledPoints& points,
                    const std::int32_t* wanted, float* out);

// The same over the corners that are not NaN, whose coefficients are made to sum to 1; where none
// is NaN, as InterpolateAll.
void InterpolateObserved(const PatchValues& values, const PulledPoints& points,
                         const std::int32_t* wanted, float* out);

// Means of three channels over the corners with `count` > 0, weighted by the trilinear
// coefficients, rounded; and the sum of these coefficients (0: no colour at all).
void InterpolateColours(const std::array<PatchValues, 3>& channels, const PatchValues& count,
                        const PulledPoints& points, const std::int32_t* wanted,
                        const std::array<std::uint16_t*, 3>& out, float* total);

}  // namespace tsdfpp
