#include <hwy/cache_control.h>

#include <algorithm>
#include <bit>

#include "core/types.h"
#include "mapper/kernels.h"
#include "mapper/volume/cube_masks.h"
#include "mapper/volume/frame_reads.h"
#include "mapper/volume/fusion_kernels.h"

// One pass of this file an instruction set; the machine's best is chosen at run time. On x86-64 all
// give the same bits: only correctly rounded operations, none contracted
// (cmake/TsdfppTarget.cmake).
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "mapper/volume/fusion_kernels_simd.cc"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include "mapper/volume/half_lanes-inl.h"
#include "mapper/volume/mask_lanes-inl.h"
#include "mapper/volume/projection_lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tsdfpp::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

using Shorts = hn::Rebind<std::uint16_t, Floats>;
using Bytes8 = hn::Rebind<std::uint8_t, Floats>;

bool Observe(const KernelFrame& frame, const BlockPlace& place, float back, BlockObservation& out) {
  const auto fetch_nothing = [](std::size_t) {};
  Projected projected;
  if (!Project(frame, place, fetch_nothing, projected)) return false;
  HWY_ALIGN std::array<float, kBlockVoxels> depth;
  HWY_ALIGN Lanes label;
  ReadPixels<kLanes>(frame.depth, projected.pixel, projected.look.data(), depth.data());
  ReadPixels<kLanes>(frame.label, projected.pixel, projected.look.data(), label.data());
  const Floats df;
  const Ints di;
  const auto minus_back = hn::Set(df, -back);
  auto any = hn::MaskFromVec(hn::Zero(di));
  for (std::size_t i = 0; i < kBlockVoxels; i += hn::Lanes(df)) {
    if (projected.look[i] == 0) {
      hn::StoreU(hn::Set(di, -1), di, &out.pixel[i]);
      continue;
    }
    const auto s = Measure(projected, depth.data(), i);
    const auto labelled = hn::Ne(hn::Load(di, &label[i]), hn::Set(di, kNoInstance));
    const auto observed = hn::And(hn::RebindMask(di, hn::Ge(s, minus_back)), labelled);
    hn::StoreU(s, df, &out.distance[i]);
    const auto pixel = hn::Load(di, &projected.pixel[i]);
    hn::StoreU(hn::IfThenElse(observed, pixel, hn::Set(di, -1)), di, &out.pixel[i]);
    any = hn::Or(any, observed);
  }
  return !hn::AllFalse(di, any);
}

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

// One vote each of the lanes `voting` of voxel i ... for the labels that they see; true where a
// label changed.
template <class M, class V>
bool Vote(M voting, V seen, std::size_t i, const LabelVotes& votes) {
  const Ints di;
  const Shorts du;
  const auto one = hn::Set(di, 1);
  const auto id = hn::PromoteTo(di, hn::LoadU(du, votes.id + i));
  const auto confidence = hn::PromoteTo(di, hn::LoadU(du, votes.confidence + i));
  const auto same = hn::Eq(id, seen);
  const auto weak =
      hn::Or(hn::Eq(id, hn::Set(di, kNoInstance)), hn::Lt(confidence, hn::Set(di, 2)));
  const auto replace = hn::And(voting, hn::AndNot(same, weak));
  const auto raised = hn::Min(hn::Add(confidence, one), hn::Set(di, votes.cap));
  const auto lowered = hn::IfThenElse(weak, one, hn::Sub(confidence, one));
  const auto voted = hn::IfThenElse(same, raised, lowered);
  hn::StoreU(hn::DemoteTo(du, hn::IfThenElse(replace, seen, id)), du, votes.id + i);
  hn::StoreU(hn::DemoteTo(du, hn::IfThenElse(voting, voted, confidence)), du, votes.confidence + i);
  return !hn::AllFalse(di, replace);
}

enum class Labels { kOne, kSome, kEvery };

template <Labels kLabels>
FusionResult FuseWith(const KernelFrame& frame, const BlockPlace& place, const FusionRule& rule,
                      TsdfBlock& block, const TsdfBlock* next, LabelVotes* votes) {
  FusionResult result;
  // The next block is fetched a few lines at a time: many at once would wait for each other.
  if (next != nullptr) hwy::Prefetch(&next->colours);
  const auto fetch_values = [&](std::size_t z) {
    if (next == nullptr) return;
    hwy::Prefetch(&next->distance[kSliceVoxels * z]);
    hwy::Prefetch(&next->distance[kSliceVoxels * z + kSliceVoxels / 2]);
    hwy::Prefetch(&next->weight[kSliceVoxels * z]);
  };
  Projected projected;
  if (!Project(frame, place, fetch_values, projected)) return result;
  HWY_ALIGN std::array<float, kBlockVoxels> depth;
  HWY_ALIGN Lanes label;
  ReadPixels<kLanes>(frame.depth, projected.pixel, projected.look.data(), depth.data());
  if (kLabels != Labels::kOne && !rule.one_label) {
    ReadPixels<kLanes>(frame.label, projected.pixel, projected.look.data(), label.data());
  } else if (kLabels == Labels::kEvery) {
    label.fill(rule.id);
  }

  const Floats df;
  const Ints di;
  const Bytes8 d8;
  const auto zero = hn::Zero(df);
  const auto one = hn::Set(df, 1.0F);
  const auto id = hn::Set(di, rule.id);
  const auto nobody = hn::Set(di, kNoInstance);
  const auto front = hn::Set(df, rule.front);
  const auto minus_back = hn::Set(df, -rule.back);
  const auto colour_band = hn::Set(df, rule.colour_band);
  const auto first_colour_band = hn::Set(df, rule.first_colour_band);
  const auto most_colour_band = hn::Max(colour_band, first_colour_band);
  const auto cap = hn::Set(df, rule.weight_cap);
  const auto full_share = hn::Div(one, hn::Add(cap, one));
  const auto minus_half = hn::Set(df, -0.5F * place.voxel);
  const bool contradiction = kLabels == Labels::kSome && rule.contradiction;
  [[maybe_unused]] const auto guard = hn::Set(df, votes == nullptr ? 0.0F : votes->guard);
  [[maybe_unused]] const auto vote_band = hn::Set(df, votes == nullptr ? 0.0F : votes->band);

  using Bytes = std::array<std::uint8_t, sizeof(BlockMask)>;
  HWY_ALIGN auto negative = std::bit_cast<Bytes>(block.negative);
  HWY_ALIGN auto band = std::bit_cast<Bytes>(block.band);
  HWY_ALIGN auto full = std::bit_cast<Bytes>(block.full);
  HWY_ALIGN Bytes taken_here{};
  HWY_ALIGN Bytes lost{};  // no longer observed
  HWY_ALIGN Bytes in_band{};
  HWY_ALIGN Bytes to_colour{};
  HWY_ALIGN Bytes cleared{};
  bool any_cleared = false;
  if (next != nullptr) {
    hwy::Prefetch(&next->observed);
    hwy::Prefetch(&next->negative);
    hwy::Prefetch(&next->band);
    hwy::Prefetch(&next->full);
    hwy::Prefetch(&next->revision);
  }
  for (std::size_t i = 0; i < kBlockVoxels; i += hn::Lanes(df)) {
    if (next != nullptr && i % kSliceVoxels == 0) {
      if (const ColourSlice* slice = next->colours[i / kSliceVoxels].get()) {
        hwy::Prefetch(slice->count.data());
      }
    }
    if (projected.look[i] == 0) continue;
    const auto s = Measure(projected, depth.data(), i);
    auto taken = hn::Ge(s, minus_back);
    auto touched = taken;
    [[maybe_unused]] auto against = hn::MaskFromVec(zero);
    const auto old_d = LoadHalves(df, &block.distance[i]);
    // Where all weights are known, they need not be read.
    const auto is_full = MaskAt(df, full.data(), i);
    const bool all_full = hn::AllTrue(df, is_full);
    const auto old_w =
        all_full ? cap : hn::ConvertTo(df, hn::PromoteTo(di, hn::LoadU(d8, &block.weight[i])));
    hn::VFromD<Ints> seen = id;
    if constexpr (kLabels != Labels::kOne) {
      seen = hn::Load(di, &label[i]);
      const auto labelled = hn::RebindMask(df, hn::Ne(seen, nobody));
      if constexpr (kLabels == Labels::kSome) {
        taken = hn::And(taken, hn::RebindMask(df, hn::Eq(seen, id)));
        if (contradiction) {
          const auto claims = hn::And(hn::Gt(old_w, zero), hn::Lt(old_d, minus_half));
          against = hn::And(hn::AndNot(taken, hn::And(touched, labelled)),
                            hn::And(claims, hn::Ge(s, minus_half)));
        }
        touched = hn::Or(taken, against);
      } else {
        taken = hn::And(taken, labelled);
        const auto owner = hn::PromoteTo(di, hn::LoadU(Shorts(), votes->id + i));
        const auto of_others = hn::AndNot(hn::Eq(owner, nobody), hn::Ne(owner, seen));
        const auto held = hn::And(hn::RebindMask(df, of_others), hn::Le(old_d, guard));
        taken = hn::AndNot(hn::And(held, hn::Lt(s, zero)), taken);
        touched = taken;
      }
    }
    if (hn::AllFalse(df, touched)) continue;
    const auto near = hn::And(taken, hn::Le(s, front));
    if (hn::AllFalse(df, near)) {
      // Free space seen once more, that no longer counts observations, stays what it is.
      const auto settled = hn::And(hn::Eq(old_d, front), hn::And(is_full, hn::Gt(s, front)));
      if (hn::AllTrue(df, hn::Or(hn::Not(touched), settled))) continue;
    } else {
      PutBits(df, near, i, in_band.data());
      if constexpr (kLabels == Labels::kEvery) {
        const auto voting = hn::And(near, hn::Le(hn::Abs(s), vote_band));
        if (Vote(hn::RebindMask(di, voting), seen, i, *votes)) votes->any_label_changed = true;
      }
      const auto off_surface = hn::Abs(s);
      auto colours = hn::And(near, hn::Le(off_surface, most_colour_band));
      if (!hn::AllFalse(df, colours)) {
        // Only between the two bands does it matter whether there is a colour.
        auto may_colour = first_colour_band;
        if (const ColourSlice* slice = block.colours[i / kSliceVoxels].get()) {
          const std::size_t k = i % kSliceVoxels;
          const auto counts = hn::PromoteTo(di, hn::LoadU(d8, &slice->count[k]));
          const auto has_colour = hn::RebindMask(df, hn::Gt(counts, hn::Zero(di)));
          may_colour = hn::IfThenElse(has_colour, colour_band, first_colour_band);
          for (const auto& channel : slice->channel) hwy::Prefetch(&channel[k]);
        }
        colours = hn::And(colours, hn::Le(off_surface, may_colour));
        PutBits(df, colours, i, to_colour.data());
        // The ends of the rows; what lies between is near.
        for (std::size_t k = i; k < i + hn::Lanes(df); k += std::min<std::size_t>(8, kLanes)) {
          const std::size_t last = k + std::min<std::size_t>(8, kLanes) - 1;
          hwy::Prefetch(frame.colour + 3 * static_cast<std::ptrdiff_t>(projected.pixel[k]));
          hwy::Prefetch(frame.colour + 3 * static_cast<std::ptrdiff_t>(projected.pixel[last]));
        }
      }
    }
    result.changed = true;
    const auto clamped = hn::Min(s, front);
    const auto more = hn::Add(old_w, one);
    const auto share = all_full ? full_share : hn::Div(one, more);
    const auto fused = hn::Add(old_d, hn::Mul(hn::Sub(clamped, old_d), share));
    auto d = hn::IfThenElse(taken, RoundLanesToHalf(df, fused), old_d);
    PutBits(df, taken, i, taken_here.data());
    if (contradiction && !hn::AllFalse(df, against)) {
      const auto free = hn::And(against, hn::Gt(s, hn::Set(df, place.voxel)));
      d = hn::IfThenElse(against, hn::IfThenElseZero(free, RoundLanesToHalf(df, clamped)), d);
      const auto taken_w = hn::IfThenElse(taken, hn::Min(more, cap), old_w);
      const auto w = hn::IfThenElse(against, hn::IfThenElseZero(free, one), taken_w);
      hn::StoreU(hn::DemoteTo(d8, Truncated(w)), d8, &block.weight[i]);
      const auto still_full = hn::AndNot(touched, is_full);
      PutBits(df, hn::Or(still_full, hn::And(touched, hn::Eq(w, cap))), i, full.data());
      PutBits(df, against, i, cleared.data());
      PutBits(df, hn::AndNot(free, against), i, lost.data());
      any_cleared = true;
    } else if (!all_full) {
      // Full weights stay what they are: then the memory need not be written.
      const auto w = hn::IfThenElse(taken, hn::Min(more, cap), old_w);
      hn::StoreU(hn::DemoteTo(d8, Truncated(w)), d8, &block.weight[i]);
      PutBits(df, hn::Or(is_full, hn::And(taken, hn::Eq(w, cap))), i, full.data());
    }
    StoreHalves(df, d, &block.distance[i]);
    PutBits(df, hn::Lt(d, zero), i, negative.data());
    PutBits(df, hn::Ge(d, minus_back), i, band.data());
  }
  const auto colour_at = std::bit_cast<BlockMask>(to_colour);
  for (std::size_t z = 0; z < kBlockSide; ++z) {
    if (colour_at[z] == 0) continue;
    FuseColours(frame, &projected.pixel[z * kSliceVoxels], colour_at[z], rule.weight_cap,
                block.MakeColours(z));
  }
  if (any_cleared) {
    const auto places = std::bit_cast<BlockMask>(cleared);
    for (int i = 0; i < kBlockVoxels; ++i) {
      if (Bit(places, i)) block.SetColour(static_cast<std::size_t>(i), {}, 0);
    }
    block.FreeColoursIfNone();
  }
  if (!result.changed) return result;
  result.in_band = std::bit_cast<BlockMask>(in_band);
  block.full = std::bit_cast<BlockMask>(full);
  const auto now_taken = std::bit_cast<BlockMask>(taken_here);
  const auto now_lost = std::bit_cast<BlockMask>(lost);
  auto new_observed = block.observed;
  auto new_negative = std::bit_cast<BlockMask>(negative);
  auto new_band = std::bit_cast<BlockMask>(band);
  for (std::size_t z = 0; z < kBlockSide; ++z) {
    new_observed[z] = (new_observed[z] | now_taken[z]) & ~now_lost[z];
    new_negative[z] &= new_observed[z];
    new_band[z] &= new_negative[z];
  }
  result.changed_signs = ChangedSigns(block.observed, block.negative, new_observed, new_negative);
  result.band_changed = block.band != new_band;
  block.observed = new_observed;
  block.negative = new_negative;
  block.band = new_band;
  return result;
}

FusionResult Fuse(const KernelFrame& frame, const BlockPlace& place, const FusionRule& rule,
                  TsdfBlock& block, const TsdfBlock* next, LabelVotes* votes) {
  if (votes != nullptr) return FuseWith<Labels::kEvery>(frame, place, rule, block, next, votes);
  if (rule.one_label) return FuseWith<Labels::kOne>(frame, place, rule, block, next, nullptr);
  return FuseWith<Labels::kSome>(frame, place, rule, block, next, nullptr);
}

}  // namespace
}  // namespace tsdfpp::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tsdfpp {

HWY_EXPORT(Observe);
HWY_EXPORT(Fuse);

bool ObserveVoxels(const KernelFrame& frame, const BlockPlace& place, float back,
                   BlockObservation& out) {
  const auto run = UsesPlainKernels() ? plain::ObserveVoxels : HWY_DYNAMIC_DISPATCH(Observe);
  return run(frame, place, back, out);
}

FusionResult FuseVoxels(const KernelFrame& frame, const BlockPlace& place, const FusionRule& rule,
                        TsdfBlock& block, const TsdfBlock* next, LabelVotes* votes) {
  const auto run = UsesPlainKernels() ? plain::FuseVoxels : HWY_DYNAMIC_DISPATCH(Fuse);
  return run(frame, place, rule, block, next, votes);
}

}  // namespace tsdfpp
#endif
