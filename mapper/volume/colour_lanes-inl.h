// The colours of a frame fused into those of a block (docs/map.md, "Fusion of an observation into a
// voxel"). Included once an instruction set, after highway.h.
#if defined(TSDFPP_MAPPER_COLOUR_LANES_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TSDFPP_MAPPER_COLOUR_LANES_INL_H_
#undef TSDFPP_MAPPER_COLOUR_LANES_INL_H_
#else
#define TSDFPP_MAPPER_COLOUR_LANES_INL_H_
#endif

#include <hwy/highway.h>

#include "mapper/volume/frame_reads.h"
#include "mapper/volume/mask_lanes-inl.h"
#include "mapper/volume/projection_lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tsdfpp::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

using Shorts = hn::Rebind<std::uint16_t, Floats>;
using Bytes8 = hn::Rebind<std::uint8_t, Floats>;

// docs/map.md: the colours of the voxels of a slice that `wanted` marks; `pixel` is of the slice.
void FuseColours(const KernelFrame& frame, const std::int32_t* pixel, std::uint64_t wanted,
                 float weight_cap, ColourSlice& colours) {
  const Floats df;
  const Ints di;
  const Shorts du;
  const std::size_t lanes = hn::Lanes(df);
  const std::uint64_t of_lanes = (1ULL << lanes) - 1;
  // All loads before their first use: they are stored singly and read as vectors.
  HWY_ALIGN std::array<std::int32_t, kSliceVoxels> colour;
  for (std::size_t i = 0; i < kSliceVoxels; i += lanes) {
    if ((wanted >> i & of_lanes) == 0) continue;
    for (std::size_t k = i; k < i + lanes; ++k) colour[k] = BytesOfColour(frame, pixel[k]);
  }
  const auto* bits = reinterpret_cast<const std::uint8_t*>(&wanted);
  const auto low_byte = hn::Set(di, 255);
  const auto half = hn::Set(df, 0.5F);
  const auto one = hn::Set(df, 1.0F);
  for (std::size_t i = 0; i < kSliceVoxels; i += lanes) {
    if ((wanted >> i & of_lanes) == 0) continue;
    const auto take = MaskAt(df, bits, i);
    const auto bytes = hn::Load(di, &colour[i]);
    const auto at_zero = hn::Eq(hn::Load(di, pixel + i), hn::Zero(di));
    const auto seen = hn::IfThenElse(at_zero, bytes, hn::ShiftRight<8>(bytes));
    const Bytes8 d8;
    std::uint8_t* counts = &colours.count[i];
    const auto count = hn::ConvertTo(df, hn::PromoteTo(di, hn::LoadU(d8, counts)));
    const auto more = hn::Add(count, one);
    const auto share = hn::Div(one, more);
    const auto fuse = [&](std::uint16_t* stored, auto level) {
      const auto old = hn::ConvertTo(df, hn::PromoteTo(di, hn::LoadU(du, stored)));
      const auto change =
          hn::Mul(hn::Sub(hn::Mul(hn::Set(df, 256.0F), hn::ConvertTo(df, level)), old), share);
      const auto mean = hn::Add(hn::Add(old, change), half);
      hn::StoreU(hn::DemoteTo(du, Truncated(hn::IfThenElse(take, mean, old))), du, stored);
    };
    fuse(&colours.channel[0][i], hn::And(seen, low_byte));
    fuse(&colours.channel[1][i], hn::And(hn::ShiftRight<8>(seen), low_byte));
    fuse(&colours.channel[2][i], hn::And(hn::ShiftRight<16>(seen), low_byte));
    const auto capped = hn::Min(more, hn::Set(df, weight_cap));
    hn::StoreU(hn::DemoteTo(d8, Truncated(hn::IfThenElse(take, capped, count))), d8, counts);
  }
}

}  // namespace
}  // namespace tsdfpp::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
