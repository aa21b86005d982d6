// Reading a frame's images at the pixels of voxels: for the fusion kernels alone.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include "mapper/volume/fusion_kernels.h"

namespace tsdfpp {

// One load after the other: from a frame, which no cache holds, gathers took longer, and so did
// what GCC made of the loops by itself.
#if defined(__GNUC__) && !defined(__clang__)
#define TSDFPP_PLAIN_LOADS __attribute__((noinline, optimize("no-tree-slp-vectorize")))
#else
#define TSDFPP_PLAIN_LOADS
#endif

// table[pixel], `kLanes` at a time, where these are to be looked at. Two pixels a load and a store,
// of which there are otherwise as many as the loads from the table.
template <std::size_t kLanes, typename From, typename To>
TSDFPP_PLAIN_LOADS void ReadPixels(const From* table, const Lanes& pixel, const std::uint8_t* look,
                                   To* out) {
  for (std::size_t i = 0; i < kBlockVoxels; i += kLanes) {
    if (look[i] == 0) continue;
    if constexpr (kLanes == 1 || std::endian::native != std::endian::little) {
      for (std::size_t k = i; k < i + kLanes; ++k) out[k] = table[pixel[k]];
    } else {
      for (std::size_t k = i; k < i + kLanes; k += 2) {
        std::uint64_t pixels;
        std::memcpy(&pixels, &pixel[k], sizeof(pixels));
        const std::array<To, 2> both{table[pixels & 0xFFFFFFFFU], table[pixels >> 32U]};
        std::memcpy(&out[k], &both, sizeof(both));
      }
    }
  }
}

// Four bytes that end with the three of a pixel, or begin with them at pixel 0: no byte beyond the
// image is read.
inline std::int32_t BytesOfColour(const KernelFrame& frame, std::int32_t pixel) {
  std::int32_t bytes;
  std::memcpy(&bytes, frame.colour + 3 * static_cast<std::ptrdiff_t>(pixel) - (pixel != 0 ? 1 : 0),
              sizeof(bytes));
  return bytes;
}

#undef TSDFPP_PLAIN_LOADS

}  // namespace tsdfpp
