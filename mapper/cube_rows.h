// Cubes of eight voxels, a row of them at a time, as bits.
#pragma once

#include <cstddef>
#include <cstdint>

namespace tsdfpp {

// Bit x is the cube between voxels x and x + 1.
struct CubeRow {
  std::uint32_t all_observed = 0;
  std::uint32_t any_negative = 0;  // of the observed corners
  std::uint32_t any_positive = 0;  // of the observed corners, zero among them

  // Is observed whole, and crossed by zero.
  std::uint32_t crossed() const { return all_observed & any_negative & any_positive; }
};

// Of the four rows of voxels [z..z+1][y..y+1]: `observed` and `negative` hold a row of bits at
// [z][y], and no voxel is negative that is not observed.
template <typename Rows>
CubeRow CubeRowOf(const Rows& observed, const Rows& negative, std::size_t z, std::size_t y) {
  CubeRow row{~0U, 0, 0};
  for (std::size_t corner = 0; corner < 4; ++corner) {
    const std::uint32_t o = observed[z + (corner >> 1U)][y + (corner & 1U)];
    const std::uint32_t n = negative[z + (corner >> 1U)][y + (corner & 1U)];
    row.all_observed &= o;
    row.any_negative |= n;
    row.any_positive |= o & ~n;
  }
  row.all_observed &= row.all_observed >> 1U;
  row.any_negative |= row.any_negative >> 1U;
  row.any_positive |= row.any_positive >> 1U;
  return row;
}

}  // namespace tsdfpp
