// Lanes of a vector to and from the bits of a block's mask. Included once an instruction set, after
// highway.h.
#if defined(TSDFPP_MAPPER_MASK_LANES_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TSDFPP_MAPPER_MASK_LANES_INL_H_
#undef TSDFPP_MAPPER_MASK_LANES_INL_H_
#else
#define TSDFPP_MAPPER_MASK_LANES_INL_H_
#endif

#include <hwy/highway.h>

#include <array>
#include <cstddef>
#include <cstdint>

HWY_BEFORE_NAMESPACE();
namespace tsdfpp::HWY_NAMESPACE {

template <class D>
using MaskOf = decltype(hwy::HWY_NAMESPACE::MaskFromVec(hwy::HWY_NAMESPACE::Zero(D())));

// Writes the lanes to bits i ... of the mask behind `bytes`; i is a multiple of the lanes.
template <class D, class M>
void PutBits(D d, M mask, std::size_t i, std::uint8_t* bytes) {
  const std::size_t lanes = hwy::HWY_NAMESPACE::Lanes(d);
  if (lanes >= 8) {
    hwy::HWY_NAMESPACE::StoreMaskBits(d, mask, bytes + i / 8);
    return;
  }
  std::array<std::uint8_t, 8> bits;
  hwy::HWY_NAMESPACE::StoreMaskBits(d, mask, bits.data());
  const auto shift = static_cast<unsigned>(i & 7U);
  const unsigned kept = bytes[i / 8] & ~(((1U << lanes) - 1U) << shift);
  bytes[i / 8] = static_cast<std::uint8_t>(kept | (static_cast<unsigned>(bits[0]) << shift));
}

// The other way round.
template <class D>
MaskOf<D> MaskAt(D d, const std::uint8_t* bytes, std::size_t i) {
  std::array<std::uint8_t, 8> bits{};
  if (hwy::HWY_NAMESPACE::Lanes(d) >= 8) {
    return hwy::HWY_NAMESPACE::LoadMaskBits(d, bytes + i / 8);
  }
  bits[0] = static_cast<std::uint8_t>(bytes[i / 8] >> (i & 7U));
  return hwy::HWY_NAMESPACE::LoadMaskBits(d, bits.data());
}

}  // namespace tsdfpp::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
