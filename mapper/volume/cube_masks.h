// The cubes of a block by the bit masks of its voxels and of the blocks around it. A cube is named
// by its lowest corner.
#pragma once

#include "mapper/volume/tsdf_block.h"

namespace tsdfpp {

inline constexpr BlockMask kNoVoxels{};
inline constexpr std::uint64_t kFirstColumn = 0x0101010101010101ULL;  // x = 0

// A slice moved by one voxel; `next` is the same slice of the block further along.
inline std::uint64_t AtNextX(std::uint64_t slice, std::uint64_t next) {
  return ((slice >> 1U) & ~(kFirstColumn << 7U)) | ((next & kFirstColumn) << 7U);
}
inline std::uint64_t AtNextY(std::uint64_t slice, std::uint64_t next) {
  return (slice >> 8U) | (next << 56U);
}

// One mask of a block and of the seven upper ones: bits 0, 1, 2 of the place are steps along x, y,
// z. Never nullptr.
using UpperMasks = std::array<const BlockMask*, 8>;

// Slice z, 0 ... 8, of the block at offset bit x, y of `which`.
inline std::uint64_t SliceOf(const UpperMasks& masks, std::size_t which, std::size_t z) {
  return z < kBlockSide ? (*masks[which])[z] : (*masks[which + 4])[0];
}

struct CubeMasks {
  BlockMask complete;  // cubes whose eight corners are observed
  BlockMask crossed;   // complete cubes that the surface passes
};
CubeMasks FindCubeMasks(const UpperMasks& observed, const UpperMasks& negative);

// One mask of a block and of the seven lower ones: bits 0, 1, 2 of the place are steps back along
// x, y, z. Never nullptr.
using LowerMasks = std::array<const BlockMask*, 8>;

// The voxels of the block that are corners of cubes.
BlockMask CornersOfCubes(const LowerMasks& cubes);

// The voxels of a block whose `observed` or `negative` changed, but for those that have neighbours
// of one sign only, before and after: these are corners of no crossed cube. What is beyond the
// block may have either sign.
BlockMask ChangedSigns(const BlockMask& old_observed, const BlockMask& old_negative,
                       const BlockMask& observed, const BlockMask& negative);

// The specification of each, in plain C++: the same bytes (mapper/kernels.h).
namespace plain {
decltype(tsdfpp::FindCubeMasks) FindCubeMasks;
decltype(tsdfpp::CornersOfCubes) CornersOfCubes;
decltype(tsdfpp::ChangedSigns) ChangedSigns;
}  // namespace plain

}  // namespace tsdfpp
