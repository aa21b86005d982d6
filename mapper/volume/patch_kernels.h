// A patch: the cube of voxels of one lattice around a block of another that was pulled back
// (docs/map.md, "Lattice"), as rows of bits and as numbers, in loops that are compiled for several
// instruction sets.
#pragma once

#include <array>
#include <cstdint>

#include "mapper/volume/tsdf_block.h"

namespace tsdfpp {

// By a rigid motion a block's voxels span at most 14 lowest corners an axis (7 sqrt(3) < 13); one
// more corner on either side.
inline constexpr int kPatchSide = 16;
inline constexpr int kPatchVoxels = kPatchSide * kPatchSide * kPatchSide;

// A number a voxel, x fastest, then y, then z; there is room for whole vectors behind.
using PatchValues = std::array<float, kPatchVoxels + kPatchSide>;

// Place x of row 16 z + y is bit x. The rows behind are there for those that look at the next ones.
using PatchRows = std::array<std::uint32_t, 2 * kPatchSide * kPatchSide>;

// A block's voxels as points of another lattice.
struct PulledPoints {
  Index3 low;   // voxel of the other lattice at the patch's place 0: one below the lowest corner
  Index3 high;  // the highest corner, included
  std::array<std::int32_t, kBlockVoxels> corner;  // place in the patch of the lowest of the eight
  std::array<std::array<float, kBlockVoxels>, 3> fraction;  // x, y, z
};

// The blocks of a grid that the patch of `points` cuts: BlockOf(points.low) and up to two more
// along each axis, x fastest; nullptr where there is none.
using PatchBlocks = std::array<const TsdfBlock*, 27>;

// The mask's bits at the patch's places; those beyond `high` mean nothing.
void PatchBits(const PatchBlocks& blocks, const PulledPoints& points, BlockMask TsdfBlock::*mask,
               PatchRows& rows);

// Of the eight corners of the cube whose lowest one is the place.
struct PatchCubes {
  PatchRows all_observed;
  PatchRows any_negative;
  PatchRows crossed;  // all are observed, and of both signs
};
void PatchCubesOf(const PatchRows& observed, const PatchRows& negative, PatchCubes& cubes);

// The points whose lowest corner is marked.
BlockMask MarkedAt(const PatchRows& rows, const PulledPoints& points);

// The points whose nearest corner is marked, of two equally near ones the upper.
BlockMask MarkedNearest(const PatchRows& rows, const PulledPoints& points);

// The points that lie in a marked cube: one on a plane of the lattice lies in the cubes on both
// sides of it.
BlockMask InMarkedCube(const PatchRows& cubes, const PulledPoints& points);

enum class PatchField { kDistance, kWeight, kColourCount, kRed, kGreen, kBlue };

// The field's values (colours in 8.8 fixed point) at the patch's places, not a number where the
// voxel is not observed; those beyond `high` mean nothing.
void PatchValuesOf(const PatchBlocks& blocks, const PulledPoints& points, PatchField field,
                   PatchValues& values);

// The specification of each, in plain C++: the same bytes (mapper/kernels.h).
namespace plain {
decltype(tsdfpp::PatchBits) PatchBits;
decltype(tsdfpp::PatchCubesOf) PatchCubesOf;
decltype(tsdfpp::MarkedAt) MarkedAt;
decltype(tsdfpp::MarkedNearest) MarkedNearest;
decltype(tsdfpp::InMarkedCube) InMarkedCube;
decltype(tsdfpp::PatchValuesOf) PatchValuesOf;
}  // namespace plain

}  // namespace tsdfpp
