// Four distances and sixteen weights at a time, by instructions that every x86-64 has.
#include "mapper/volume/value_masks.h"

#ifdef __SSE2__
#include <emmintrin.h>
#endif

#include "mapper/kernels.h"

namespace tsdfpp {

#ifdef __SSE2__
namespace {

struct SliceMasks {
  std::uint64_t observed = 0;
  std::uint64_t negative = 0;   // distance < 0, observed or not
  std::uint64_t near_back = 0;  // distance >= -back, observed or not
};

SliceMasks MasksOfSlice(const Half* halves, const std::uint8_t* weight, float back) {
  SliceMasks masks;
  std::array<float, kSliceVoxels> distance;
  ToFloats(halves, distance.size(), distance.data());
  const __m128 zero = _mm_setzero_ps();
  const __m128 minus_back = _mm_set1_ps(-back);
  for (unsigned i = 0; i < kSliceVoxels; i += 4) {
    const __m128 d = _mm_loadu_ps(&distance[i]);
    const auto bits = [i](__m128 test) {
      return static_cast<std::uint64_t>(static_cast<unsigned>(_mm_movemask_ps(test))) << i;
    };
    masks.negative |= bits(_mm_cmplt_ps(d, zero));
    masks.near_back |= bits(_mm_cmpge_ps(d, minus_back));
  }
  for (unsigned i = 0; i < kSliceVoxels; i += 16) {
    const __m128i w = _mm_loadu_si128(reinterpret_cast<const __m128i*>(weight + i));
    const int none = _mm_movemask_epi8(_mm_cmpeq_epi8(w, _mm_setzero_si128()));
    masks.observed |= static_cast<std::uint64_t>(static_cast<unsigned>(none) ^ 0xFFFFU) << i;
  }
  return masks;
}

}  // namespace
#endif

ValueMasks MasksOfValues(const TsdfBlock& block, float back) {
#ifdef __SSE2__
  if (!UsesPlainKernels()) {
    ValueMasks masks;
    for (std::size_t z = 0; z < kBlockSide; ++z) {
      const auto [observed, negative, near_back] =
          MasksOfSlice(&block.distance[kSliceVoxels * z], &block.weight[kSliceVoxels * z], back);
      masks.observed[z] = observed;
      masks.negative[z] = negative & observed;
      masks.band[z] = near_back & negative & observed;
    }
    return masks;
  }
#endif
  return plain::MasksOfValues(block, back);
}

}  // namespace tsdfpp
