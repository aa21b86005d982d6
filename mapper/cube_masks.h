// The cubes of a block by the bit masks of its voxels and of the seven blocks further along x, y,
// z: 64 at a time.
#pragma once

#include "mapper/tsdf_block.h"

namespace tsdfpp {

inline constexpr BlockMask kNoVoxels{};
inline constexpr std::uint64_t kFirstColumn = 0x0101010101010101ULL;  // x = 0

// Slices moved by one voxel; `next` is the same slice of the block further along.
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

// For the cubes named by the voxels of slice z: the four lower corners' bits, joined.
template <typename Join>
std::uint64_t JoinFour(const UpperMasks& masks, std::size_t z, const Join& join) {
  const std::uint64_t here = SliceOf(masks, 0, z);
  const std::uint64_t next_y = SliceOf(masks, 2, z);
  const std::uint64_t rows = join(here, AtNextX(here, SliceOf(masks, 1, z)));
  const std::uint64_t next_rows = join(next_y, AtNextX(next_y, SliceOf(masks, 3, z)));
  return join(rows, AtNextY(rows, next_rows));
}

// A cube is named by its lowest voxel.
struct CubeMasks {
  BlockMask complete;  // cubes whose eight corners are observed
  BlockMask crossed;   // complete cubes that the surface passes
};
inline CubeMasks FindCubeMasks(const UpperMasks& observed, const UpperMasks& negative) {
  const auto both = [](std::uint64_t a, std::uint64_t b) { return a & b; };
  const auto either = [](std::uint64_t a, std::uint64_t b) { return a | b; };
  CubeMasks cubes;
  std::uint64_t lower_complete = JoinFour(observed, 0, both);
  std::uint64_t lower_any = JoinFour(negative, 0, either);
  std::uint64_t lower_all = JoinFour(negative, 0, both);
  for (std::size_t z = 0; z < kBlockSide; ++z) {
    const std::uint64_t upper_complete = JoinFour(observed, z + 1, both);
    const std::uint64_t upper_any = JoinFour(negative, z + 1, either);
    const std::uint64_t upper_all = JoinFour(negative, z + 1, both);
    cubes.complete[z] = lower_complete & upper_complete;
    cubes.crossed[z] = cubes.complete[z] & (lower_any | upper_any) & ~(lower_all & upper_all);
    lower_complete = upper_complete;
    lower_any = upper_any;
    lower_all = upper_all;
  }
  return cubes;
}

}  // namespace tsdfpp
