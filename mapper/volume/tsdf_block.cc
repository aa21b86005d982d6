#include "mapper/volume/tsdf_block.h"

#include <algorithm>
#include <atomic>

#ifdef __SSE2__
#include <emmintrin.h>
#endif

namespace tsdfpp {
namespace {

struct SliceMasks {
  std::uint64_t observed = 0;
  std::uint64_t negative = 0;   // distance < 0, observed or not
  std::uint64_t near_back = 0;  // distance >= -back, observed or not
};

SliceMasks MasksOf(const Half* halves, const std::uint8_t* weight, float back) {
  SliceMasks masks;
  std::array<float, 64> distance;
  ToFloats(halves, distance.size(), distance.data());
#ifdef __SSE2__
  const __m128 zero = _mm_setzero_ps();
  const __m128 minus_back = _mm_set1_ps(-back);
  for (unsigned i = 0; i < 64; i += 4) {
    const __m128 d = _mm_loadu_ps(&distance[i]);
    const auto bits = [i](__m128 test) {
      return static_cast<std::uint64_t>(static_cast<unsigned>(_mm_movemask_ps(test))) << i;
    };
    masks.negative |= bits(_mm_cmplt_ps(d, zero));
    masks.near_back |= bits(_mm_cmpge_ps(d, minus_back));
  }
  for (unsigned i = 0; i < 64; i += 16) {
    const __m128i w = _mm_loadu_si128(reinterpret_cast<const __m128i*>(weight + i));
    const int none = _mm_movemask_epi8(_mm_cmpeq_epi8(w, _mm_setzero_si128()));
    masks.observed |= static_cast<std::uint64_t>(static_cast<unsigned>(none) ^ 0xFFFFU) << i;
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
  full = {};
  for (std::size_t z = 0; z < kBlockSide; ++z) {
    const auto [o, n, b] = MasksOf(&distance[64 * z], &weight[64 * z], back);
    observed[z] = o;
    negative[z] = n & o;
    band[z] = b & n & o;
  }
  FreeColoursIfNone();
  return observed != old_observed || negative != old_negative || band != old_band;
}

std::size_t BytesOf(const TsdfGrid& grid) {
  std::size_t bytes = grid.TableBytes();
  for (const TsdfGrid::Entry& entry : grid.entries()) bytes += entry.block->Bytes();
  return bytes;
}

}  // namespace tsdfpp
