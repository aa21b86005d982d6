#include "mapper/tsdf_block.h"

#include <atomic>

#ifdef __SSE2__
#include <emmintrin.h>
#endif

namespace tsdfpp {
namespace {

// Rows of 10 bits, x = -1 ... 8, for y, z = -1 ... 8.
using Rows = std::array<std::array<std::uint16_t, 10>, 10>;

std::uint16_t RowOf(const BlockMask* mask, int y, int z) {
  if (mask == nullptr) return 0;
  return static_cast<std::uint16_t>(
      ((*mask)[static_cast<std::size_t>(z)] >> static_cast<unsigned>(8 * y)) & 0xFFU);
}

using Neighbours = std::array<const TsdfBlock*, 27>;

Neighbours FindNeighbours(const TsdfGrid& grid, const Index3& block) {
  Neighbours neighbours{};
  std::size_t i = 0;
  for (int z = -1; z <= 1; ++z) {
    for (int y = -1; y <= 1; ++y) {
      for (int x = -1; x <= 1; ++x) neighbours[i++] = grid.Find(block + Index3{x, y, z});
    }
  }
  return neighbours;
}

Rows GatherRows(const Neighbours& neighbours, BlockMask TsdfBlock::*mask) {
  Rows rows{};
  for (int z = -1; z <= 8; ++z) {
    const int bz = z < 0 ? 0 : (z > 7 ? 2 : 1);
    for (int y = -1; y <= 8; ++y) {
      const int by = y < 0 ? 0 : (y > 7 ? 2 : 1);
      const auto* of = &neighbours[static_cast<std::size_t>(9 * bz + 3 * by)];
      const auto row = [&](int bx) {
        return RowOf(of[bx] == nullptr ? nullptr : &(of[bx]->*mask), y & 7, z & 7);
      };
      rows[static_cast<std::size_t>(z + 1)][static_cast<std::size_t>(y + 1)] =
          static_cast<std::uint16_t>((row(0) >> 7U) | (row(1) << 1U) | ((row(2) & 1U) << 9U));
    }
  }
  return rows;
}

// Row z, y, bit x: whether the cube named by voxel (x - 1, y - 1, z - 1) of the block is crossed.
using CrossedCubes = std::array<std::array<std::uint16_t, 9>, 9>;

CrossedCubes CrossedOf(const Rows& observed, const Rows& negative) {
  CrossedCubes crossed{};
  for (std::size_t z = 0; z < 9; ++z) {
    for (std::size_t y = 0; y < 9; ++y) {
      std::uint32_t all = 0x3FF;
      std::uint32_t any_negative = 0;
      std::uint32_t any_positive = 0;
      for (std::size_t corner = 0; corner < 4; ++corner) {
        const std::size_t cz = z + (corner >> 1U);
        const std::size_t cy = y + (corner & 1U);
        all &= observed[cz][cy];
        any_negative |= negative[cz][cy];
        any_positive |= static_cast<std::uint32_t>(observed[cz][cy] & ~negative[cz][cy]);
      }
      all &= all >> 1U;
      any_negative |= any_negative >> 1U;
      any_positive |= any_positive >> 1U;
      crossed[z][y] = static_cast<std::uint16_t>(all & any_negative & any_positive & 0x1FFU);
    }
  }
  return crossed;
}

struct SliceMasks {
  std::uint64_t observed = 0;
  std::uint64_t negative = 0;   // distance < 0, observed or not
  std::uint64_t near_back = 0;  // distance >= -back, observed or not
};

SliceMasks MasksOf(const float* distance, const float* weight, float back) {
  SliceMasks masks;
#ifdef __SSE2__
  const __m128 zero = _mm_setzero_ps();
  const __m128 minus_back = _mm_set1_ps(-back);
  for (unsigned i = 0; i < 64; i += 4) {
    const __m128 d = _mm_loadu_ps(distance + i);
    const auto bits = [i](__m128 test) {
      return static_cast<std::uint64_t>(static_cast<unsigned>(_mm_movemask_ps(test))) << i;
    };
    masks.observed |= bits(_mm_cmpgt_ps(_mm_loadu_ps(weight + i), zero));
    masks.negative |= bits(_mm_cmplt_ps(d, zero));
    masks.near_back |= bits(_mm_cmpge_ps(d, minus_back));
  }
#else
  for (unsigned i = 0; i < 64; ++i) {
    masks.observed |= static_cast<std::uint64_t>(weight[i] > 0) << i;
    masks.negative |= static_cast<std::uint64_t>(distance[i] < 0) << i;
    masks.near_back |= static_cast<std::uint64_t>(distance[i] >= -back) << i;
  }
#endif
  return masks;
}

}  // namespace

std::uint64_t NewRevision() {
  // Each thread takes a batch at a time, so that they do not wait for each other.
  constexpr std::uint64_t kBatch = 4096;
  static std::atomic<std::uint64_t> next_batch{1};
  thread_local std::uint64_t next = 0;
  if (next % kBatch == 0) next = kBatch * next_batch.fetch_add(1, std::memory_order_relaxed);
  return next++;
}

bool TsdfBlock::UpdateMasks(float back) {
  revision = NewRevision();
  const BlockMask old_observed = observed;
  const BlockMask old_negative = negative;
  const BlockMask old_band = band;
  for (std::size_t z = 0; z < kBlockSide; ++z) {
    const auto [o, n, b] = MasksOf(&distance[64 * z], &weight[64 * z], back);
    observed[z] = o;
    negative[z] = n & o;
    band[z] = b & n & o;
  }
  return observed != old_observed || negative != old_negative || band != old_band;
}

BlockMask FindCover(const TsdfGrid& grid, const Index3& block) {
  const Neighbours neighbours = FindNeighbours(grid, block);
  const CrossedCubes crossed = CrossedOf(GatherRows(neighbours, &TsdfBlock::observed),
                                         GatherRows(neighbours, &TsdfBlock::negative));
  BlockMask cover = neighbours[13] == nullptr ? BlockMask{} : neighbours[13]->band;
  for (std::size_t z = 0; z < kBlockSide; ++z) {
    for (std::size_t y = 0; y < kBlockSide; ++y) {
      // A voxel is a corner of the cubes named one lower, and its own, along each axis.
      std::uint32_t row = crossed[z][y] | crossed[z][y + 1] | crossed[z + 1][y] |
                          static_cast<std::uint32_t>(crossed[z + 1][y + 1]);
      row = (row | (row >> 1U)) & 0xFFU;
      cover[z] |= static_cast<std::uint64_t>(row) << (8 * y);
    }
  }
  return cover;
}

}  // namespace tsdfpp
