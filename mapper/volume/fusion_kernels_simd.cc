// Longer than most files: one loop with its parts, which are compiled together for each instruction
// set.
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

#include "mapper/volume/colour_lanes-inl.h"
#include "mapper/volume/half_lanes-inl.h"
#include "mapper/volume/mask_lanes-inl.h"
#include "mapper/volume/projection_lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tsdfpp::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

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

// The block that comes next is fetched into the cache meanwhile, a few lines at a time: many at
// once would wait for each other.
class NextBlock {
 public:
  explicit NextBlock(const TsdfBlock* block) : block_(block) {
    if (block_ != nullptr) hwy::Prefetch(&block_->colours);
  }
  HWY_INLINE void FetchValues(std::size_t z) const {
    if (block_ == nullptr) return;
    hwy::Prefetch(&block_->distance[kSliceVoxels * z]);
    hwy::Prefetch(&block_->distance[kSliceVoxels * z + kSliceVoxels / 2]);
    hwy::Prefetch(&block_->weight[kSliceVoxels * z]);
  }
  HWY_INLINE void FetchMasks() const {
    if (block_ == nullptr) return;
    hwy::Prefetch(&block_->observed);
    hwy::Prefetch(&block_->negative);
    hwy::Prefetch(&block_->band);
    hwy::Prefetch(&block_->full);
    hwy::Prefetch(&block_->revision);
  }
  HWY_INLINE void FetchColours(std::size_t z) const {
    if (block_ == nullptr) return;
    if (const ColourSlice* slice = block_->colours[z].get()) hwy::Prefetch(slice->count.data());
  }

 private:
  const TsdfBlock* block_;
};

// The numbers of a fusion, in each lane.
struct RuleLanes {
  RuleLanes(const BlockPlace& place, const FusionRule& rule, const LabelVotes* votes)
      : id(hn::Set(Ints(), rule.id)),
        nobody(hn::Set(Ints(), kNoInstance)),
        front(hn::Set(Floats(), rule.front)),
        minus_back(hn::Set(Floats(), -rule.back)),
        colour_band(hn::Set(Floats(), rule.colour_band)),
        first_colour_band(hn::Set(Floats(), rule.first_colour_band)),
        most_colour_band(hn::Max(colour_band, first_colour_band)),
        cap(hn::Set(Floats(), rule.weight_cap)),
        full_share(hn::Div(hn::Set(Floats(), 1.0F), hn::Add(cap, hn::Set(Floats(), 1.0F)))),
        voxel(hn::Set(Floats(), place.voxel)),
        half_inside(hn::Set(Floats(), -0.5F * place.voxel)),
        guard(hn::Set(Floats(), votes == nullptr ? 0.0F : votes->guard)),
        vote_band(hn::Set(Floats(), votes == nullptr ? 0.0F : votes->band)) {}

  VI id;
  VI nobody;
  VF front;
  VF minus_back;
  VF colour_band;
  VF first_colour_band;
  VF most_colour_band;
  VF cap;
  VF full_share;  // of an observation where the weight is at its cap
  VF voxel;
  VF half_inside;
  VF guard;
  VF vote_band;
};

// Masks of the block, a bit a voxel: those that it has, changed by the fusion, and what happened.
struct FusionMasks {
  using Bytes = std::array<std::uint8_t, sizeof(BlockMask)>;
  explicit FusionMasks(const TsdfBlock& block)
      : negative(std::bit_cast<Bytes>(block.negative)),
        band(std::bit_cast<Bytes>(block.band)),
        full(std::bit_cast<Bytes>(block.full)) {}

  HWY_ALIGN Bytes negative;  // distance < 0, observed or not
  HWY_ALIGN Bytes band;      // distance >= -back, likewise
  HWY_ALIGN Bytes full;
  HWY_ALIGN Bytes taken{};
  HWY_ALIGN Bytes lost{};  // no longer observed
  HWY_ALIGN Bytes in_band{};
  HWY_ALIGN Bytes to_colour{};
  HWY_ALIGN Bytes cleared{};
  bool any_cleared = false;
};

// What the lanes' voxels have before the frame.
struct Stored {
  VF distance;
  VF weight;
  MF is_full;  // it is known that the weight is at its cap
  bool all_full;
};

HWY_INLINE Stored ReadVoxels(const TsdfBlock& block, const FusionMasks& masks,
                             const RuleLanes& rule, std::size_t i) {
  const Floats df;
  Stored stored;
  stored.distance = LoadHalves(df, &block.distance[i]);
  // Where all weights are known, they need not be read.
  stored.is_full = MaskAt(df, masks.full.data(), i);
  stored.all_full = hn::AllTrue(df, stored.is_full);
  stored.weight =
      stored.all_full
          ? rule.cap
          : hn::ConvertTo(df, hn::PromoteTo(Ints(), hn::LoadU(Bytes8(), &block.weight[i])));
  return stored;
}

// Which lanes the observation changes.
struct Wanted {
  MF taken;    // those that take it
  MF against;  // those that it contradicts
  MF touched;  // either
  VI seen;     // the labels
};

template <Labels kLabels>
HWY_INLINE Wanted WhoTakes(const RuleLanes& rule, bool contradiction, const Stored& stored, VF s,
                           const Lanes& label, std::size_t i, const LabelVotes* votes) {
  const Floats df;
  const Ints di;
  Wanted wanted;
  wanted.taken = hn::Ge(s, rule.minus_back);
  wanted.against = hn::MaskFromVec(hn::Zero(df));
  wanted.touched = wanted.taken;
  wanted.seen = rule.id;
  if constexpr (kLabels == Labels::kOne) return wanted;
  wanted.seen = hn::Load(di, &label[i]);
  const auto labelled = hn::RebindMask(df, hn::Ne(wanted.seen, rule.nobody));
  if constexpr (kLabels == Labels::kSome) {
    wanted.taken = hn::And(wanted.taken, hn::RebindMask(df, hn::Eq(wanted.seen, rule.id)));
    if (contradiction) {
      const auto claims =
          hn::And(hn::Gt(stored.weight, hn::Zero(df)), hn::Lt(stored.distance, rule.half_inside));
      wanted.against = hn::And(hn::AndNot(wanted.taken, hn::And(wanted.touched, labelled)),
                               hn::And(claims, hn::Ge(s, rule.half_inside)));
    }
    wanted.touched = hn::Or(wanted.taken, wanted.against);
  } else {
    const auto owner = hn::PromoteTo(di, hn::LoadU(Shorts(), votes->id + i));
    const auto of_others = hn::AndNot(hn::Eq(owner, rule.nobody), hn::Ne(owner, wanted.seen));
    const auto held = hn::And(hn::RebindMask(df, of_others), hn::Le(stored.distance, rule.guard));
    wanted.taken =
        hn::AndNot(hn::And(held, hn::Lt(s, hn::Zero(df))), hn::And(wanted.taken, labelled));
    wanted.touched = wanted.taken;
  }
  return wanted;
}

// Lanes of free space seen once more, that no longer counts observations: they stay what they are.
HWY_INLINE MF Settled(const RuleLanes& rule, const Stored& stored, VF s) {
  return hn::And(hn::Eq(stored.distance, rule.front),
                 hn::And(stored.is_full, hn::Gt(s, rule.front)));
}

// Marks the lanes of `near` that take a colour; these and the pixels' colours are fetched.
HWY_INLINE void ChooseColours(const KernelFrame& frame, const TsdfBlock& block,
                              const RuleLanes& rule, const Projected& projected, MF near, VF s,
                              std::size_t i, FusionMasks& masks) {
  const Floats df;
  const Ints di;
  const auto off_surface = hn::Abs(s);
  const auto colours = hn::And(near, hn::Le(off_surface, rule.most_colour_band));
  if (hn::AllFalse(df, colours)) return;
  // Only between the two bands does it matter whether there is a colour.
  auto may_colour = rule.first_colour_band;
  if (const ColourSlice* slice = block.colours[i / kSliceVoxels].get()) {
    const std::size_t k = i % kSliceVoxels;
    const auto counts = hn::PromoteTo(di, hn::LoadU(Bytes8(), &slice->count[k]));
    const auto has_colour = hn::RebindMask(df, hn::Gt(counts, hn::Zero(di)));
    may_colour = hn::IfThenElse(has_colour, rule.colour_band, rule.first_colour_band);
    for (const auto& channel : slice->channel) hwy::Prefetch(&channel[k]);
  }
  PutBits(df, hn::And(colours, hn::Le(off_surface, may_colour)), i, masks.to_colour.data());
  // The ends of the rows; what lies between is near.
  for (std::size_t k = i; k < i + hn::Lanes(df); k += std::min<std::size_t>(8, kLanes)) {
    const std::size_t last = k + std::min<std::size_t>(8, kLanes) - 1;
    hwy::Prefetch(frame.colour + 3 * static_cast<std::ptrdiff_t>(projected.pixel[k]));
    hwy::Prefetch(frame.colour + 3 * static_cast<std::ptrdiff_t>(projected.pixel[last]));
  }
}

HWY_INLINE void StoreWeights(VF weight, MF full, std::size_t i, TsdfBlock& block,
                             FusionMasks& masks) {
  hn::StoreU(hn::DemoteTo(Bytes8(), Truncated(weight)), Bytes8(), &block.weight[i]);
  PutBits(Floats(), full, i, masks.full.data());
}

// New distances and weights of the lanes, and the masks that follow from them.
HWY_INLINE void StoreFused(const RuleLanes& rule, const Stored& stored, const Wanted& wanted,
                           bool contradiction, VF s, VF facing, MF settled, std::size_t i,
                           TsdfBlock& block, FusionMasks& masks) {
  const Floats df;
  const auto one = hn::Set(df, 1.0F);
  const auto clamped = hn::Min(s, rule.front);
  const auto more = hn::Add(stored.weight, one);
  const auto share = stored.all_full ? rule.full_share : hn::Div(one, more);
  const auto seen = hn::Min(hn::Mul(s, facing), rule.front);
  const auto fused = hn::Add(stored.distance, hn::Mul(hn::Sub(seen, stored.distance), share));
  const auto changed = hn::AndNot(settled, wanted.taken);
  auto d = hn::IfThenElse(changed, RoundLanesToHalf(df, fused), stored.distance);
  PutBits(df, wanted.taken, i, masks.taken.data());
  if (contradiction && !hn::AllFalse(df, wanted.against)) {
    const auto free = hn::And(wanted.against, hn::Gt(s, rule.voxel));
    d = hn::IfThenElse(wanted.against, hn::IfThenElseZero(free, RoundLanesToHalf(df, clamped)), d);
    const auto taken_w = hn::IfThenElse(wanted.taken, hn::Min(more, rule.cap), stored.weight);
    const auto w = hn::IfThenElse(wanted.against, hn::IfThenElseZero(free, one), taken_w);
    const auto known = hn::AndNot(wanted.touched, stored.is_full);
    StoreWeights(w, hn::Or(known, hn::And(wanted.touched, hn::Eq(w, rule.cap))), i, block, masks);
    PutBits(df, wanted.against, i, masks.cleared.data());
    PutBits(df, hn::AndNot(free, wanted.against), i, masks.lost.data());
    masks.any_cleared = true;
  } else if (!stored.all_full) {
    // Full weights stay what they are: then the memory need not be written.
    const auto w = hn::IfThenElse(wanted.taken, hn::Min(more, rule.cap), stored.weight);
    const auto reached = hn::And(wanted.taken, hn::Eq(w, rule.cap));
    StoreWeights(w, hn::Or(stored.is_full, reached), i, block, masks);
  }
  StoreHalves(df, d, &block.distance[i]);
  PutBits(df, hn::Lt(d, hn::Zero(df)), i, masks.negative.data());
  PutBits(df, hn::Ge(d, rule.minus_back), i, masks.band.data());
}

void FuseAllColours(const KernelFrame& frame, const Projected& projected, const FusionMasks& masks,
                    float weight_cap, TsdfBlock& block) {
  const auto colour_at = std::bit_cast<BlockMask>(masks.to_colour);
  for (std::size_t z = 0; z < kBlockSide; ++z) {
    if (colour_at[z] == 0) continue;
    FuseColours(frame, &projected.pixel[z * kSliceVoxels], colour_at[z], weight_cap,
                block.MakeColours(z));
  }
  if (!masks.any_cleared) return;
  const auto cleared = std::bit_cast<BlockMask>(masks.cleared);
  for (int i = 0; i < kBlockVoxels; ++i) {
    if (Bit(cleared, i)) block.SetColour(static_cast<std::size_t>(i), {}, 0);
  }
  block.FreeColoursIfNone();
}

// The block's masks as they are after the fusion, and how they changed.
void UpdateMasks(const FusionMasks& masks, TsdfBlock& block, FusionResult& result) {
  result.in_band = std::bit_cast<BlockMask>(masks.in_band);
  block.full = std::bit_cast<BlockMask>(masks.full);
  const auto taken = std::bit_cast<BlockMask>(masks.taken);
  const auto lost = std::bit_cast<BlockMask>(masks.lost);
  auto observed = block.observed;
  auto negative = std::bit_cast<BlockMask>(masks.negative);
  auto band = std::bit_cast<BlockMask>(masks.band);
  for (std::size_t z = 0; z < kBlockSide; ++z) {
    observed[z] = (observed[z] | taken[z]) & ~lost[z];
    negative[z] &= observed[z];
    band[z] &= negative[z];
  }
  result.changed_signs = ChangedSigns(block.observed, block.negative, observed, negative);
  result.band_changed = block.band != band;
  block.observed = observed;
  block.negative = negative;
  block.band = band;
}

template <Labels kLabels>
FusionResult FuseWith(const KernelFrame& frame, const BlockPlace& place, const FusionRule& rule,
                      TsdfBlock& block, const NextBlock& next, LabelVotes* votes) {
  FusionResult result;
  Projected projected;
  const auto fetch_values = [&](std::size_t z) { next.FetchValues(z); };
  if (!Project(frame, place, fetch_values, projected)) return result;
  HWY_ALIGN std::array<float, kBlockVoxels> depth;
  HWY_ALIGN Lanes label;
  ReadPixels<kLanes>(frame.depth, projected.pixel, projected.look.data(), depth.data());
  if (kLabels != Labels::kOne && !rule.one_label) {
    ReadPixels<kLanes>(frame.label, projected.pixel, projected.look.data(), label.data());
  } else if (kLabels == Labels::kEvery) {
    label.fill(rule.id);
  }

  // The background's distances stay along the rays.
  const bool faces =
      frame.facing != nullptr && (kLabels == Labels::kEvery || rule.id != kBackground);
  HWY_ALIGN std::array<float, kBlockVoxels> facing;
  if (faces) {
    ReadPixels<kLanes>(frame.facing, projected.pixel, projected.look.data(), facing.data());
  }
  const Floats df;
  const auto one = hn::Set(df, 1.0F);
  const RuleLanes lanes(place, rule, votes);
  const bool contradiction = kLabels == Labels::kSome && rule.contradiction;
  FusionMasks masks(block);
  next.FetchMasks();
  for (std::size_t i = 0; i < kBlockVoxels; i += hn::Lanes(df)) {
    if (i % kSliceVoxels == 0) next.FetchColours(i / kSliceVoxels);
    if (projected.look[i] == 0) continue;
    const auto s = Measure(projected, depth.data(), i);
    const Stored stored = ReadVoxels(block, masks, lanes, i);
    const Wanted wanted = WhoTakes<kLabels>(lanes, contradiction, stored, s, label, i, votes);
    if (hn::AllFalse(df, wanted.touched)) continue;
    const auto near = hn::And(wanted.taken, hn::Le(s, lanes.front));
    const auto settled = Settled(lanes, stored, s);
    if (hn::AllFalse(df, near)) {
      if (hn::AllFalse(df, hn::AndNot(settled, wanted.touched))) continue;
    } else {
      PutBits(df, near, i, masks.in_band.data());
      if constexpr (kLabels == Labels::kEvery) {
        const auto voting = hn::And(near, hn::Le(hn::Abs(s), lanes.vote_band));
        if (Vote(hn::RebindMask(Ints(), voting), wanted.seen, i, *votes)) {
          votes->any_label_changed = true;
        }
      }
      ChooseColours(frame, block, lanes, projected, near, s, i, masks);
    }
    result.changed = true;
    StoreFused(lanes, stored, wanted, contradiction, s, faces ? hn::Load(df, &facing[i]) : one,
               settled, i, block, masks);
  }
  if (!result.changed) return result;
  FuseAllColours(frame, projected, masks, rule.weight_cap, block);
  UpdateMasks(masks, block, result);
  return result;
}

FusionResult Fuse(const KernelFrame& frame, const BlockPlace& place, const FusionRule& rule,
                  TsdfBlock& block, const TsdfBlock* next, LabelVotes* votes) {
  const NextBlock ahead(next);
  if (votes != nullptr) return FuseWith<Labels::kEvery>(frame, place, rule, block, ahead, votes);
  if (rule.one_label) return FuseWith<Labels::kOne>(frame, place, rule, block, ahead, nullptr);
  return FuseWith<Labels::kSome>(frame, place, rule, block, ahead, nullptr);
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
