#include "mapper/index/index_kernels.h"
#include "mapper/kernels.h"

// One pass of this file an instruction set (see fusion_kernels_simd.cc).
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "mapper/index/index_kernels_simd.cc"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include "mapper/volume/mask_lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tsdfpp::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

using Ints = hn::CappedTag<std::int32_t, 16>;
using Shorts = hn::Rebind<std::uint16_t, Ints>;
using Floats = hn::Rebind<float, Ints>;

VotesCounted Votes(const BlockMask& votes, InstanceId id, int confidence_cap,
                   const InstanceId* active, std::uint8_t* confidences) {
  const hn::CappedTag<std::int16_t, 32> d;
  const hn::Rebind<std::uint8_t, decltype(d)> d8;
  const auto* bits = reinterpret_cast<const std::uint8_t*>(votes.data());
  VotesCounted counted;
  auto* other_bits = reinterpret_cast<std::uint8_t*>(counted.others.data());
  auto* saturated_bits = reinterpret_cast<std::uint8_t*>(counted.saturated.data());
  const auto wanted = hn::Set(d, static_cast<std::int16_t>(id));
  const auto cap = hn::Set(d, static_cast<std::int16_t>(confidence_cap));
  const auto one = hn::Set(d, 1);
  for (std::size_t i = 0; i < kBlockVoxels; i += hn::Lanes(d)) {
    const auto voting = MaskAt(d, bits, i);
    if (hn::AllFalse(d, voting)) continue;
    const auto ids = hn::LoadU(d, reinterpret_cast<const std::int16_t*>(active + i));
    const auto confidence = hn::PromoteTo(d, hn::LoadU(d8, confidences + i));
    const auto same = hn::Eq(ids, wanted);
    const auto raised = hn::And(voting, hn::And(same, hn::Lt(confidence, cap)));
    const auto more = hn::Add(confidence, one);
    if (!hn::AllFalse(d, raised)) {  // else the memory need not be written
      hn::StoreU(hn::DemoteTo(d8, hn::IfThenElse(raised, more, confidence)), d8, confidences + i);
    }
    PutBits(d, hn::AndNot(same, voting), i, other_bits);
    PutBits(d, hn::And(voting, hn::And(same, hn::Gt(more, hn::Sub(cap, one)))), i, saturated_bits);
  }
  return counted;
}

void Alone(const BlockMask& covered, InstanceId id, InstanceId* ids) {
  const hn::CappedTag<std::uint16_t, 32> d;
  const auto* bits = reinterpret_cast<const std::uint8_t*>(covered.data());
  for (std::size_t i = 0; i < kBlockVoxels; i += hn::Lanes(d)) {
    const auto listed = hn::IfThenElse(MaskAt(d, bits, i), hn::Set(d, id), hn::Set(d, kNoInstance));
    hn::StoreU(listed, d, ids + i);
  }
}

void Insert(const BlockMask& covered, const float* distance, InstanceId id,
            const OrderedLists& lists) {
  const Ints di;
  const Shorts du;
  const Floats df;
  const auto* bits = reinterpret_cast<const std::uint8_t*>(covered.data());
  for (std::size_t i = 0; i < kBlockVoxels; i += hn::Lanes(di)) {
    auto carried = MaskAt(df, bits, i);
    if (hn::AllFalse(df, carried)) continue;
    auto d = hn::LoadU(df, distance + i);
    auto o = hn::Set(di, id);
    // What is displaced stays before those that are as near: it came before them.
    auto displaces = hn::MaskFromVec(hn::Zero(df));
    for (int layer = 0; layer < lists.layers; ++layer) {
      const std::size_t at = static_cast<std::size_t>(layer) * kBlockVoxels + i;
      const auto other_d = hn::LoadU(df, lists.distance + at);
      const auto other_o = hn::PromoteTo(di, hn::LoadU(du, lists.id + at));
      const auto swap = hn::And(carried, hn::Or(displaces, hn::Lt(d, other_d)));
      displaces = swap;
      const auto swap_o = hn::RebindMask(di, swap);
      hn::StoreU(hn::IfThenElse(swap, d, other_d), df, lists.distance + at);
      hn::StoreU(hn::DemoteTo(du, hn::IfThenElse(swap_o, o, other_o)), du, lists.id + at);
      d = hn::IfThenElse(swap, other_d, d);
      o = hn::IfThenElse(swap_o, other_o, o);
      // What was swapped out of an empty place is nothing, and infinitely far.
    }
  }
}

}  // namespace
}  // namespace tsdfpp::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tsdfpp {

HWY_EXPORT(Votes);
HWY_EXPORT(Alone);
HWY_EXPORT(Insert);

VotesCounted VoteForActive(const BlockMask& votes, InstanceId id, int confidence_cap,
                           const InstanceId* active, std::uint8_t* confidences) {
  const auto run = UsesPlainKernels() ? plain::VoteForActive : HWY_DYNAMIC_DISPATCH(Votes);
  return run(votes, id, confidence_cap, active, confidences);
}

void ListAlone(const BlockMask& covered, InstanceId id, InstanceId* ids) {
  const auto run = UsesPlainKernels() ? plain::ListAlone : HWY_DYNAMIC_DISPATCH(Alone);
  run(covered, id, ids);
}

void InsertByDistance(const BlockMask& covered, const float* distance, InstanceId id,
                      const OrderedLists& lists) {
  const auto run = UsesPlainKernels() ? plain::InsertByDistance : HWY_DYNAMIC_DISPATCH(Insert);
  run(covered, distance, id, lists);
}

}  // namespace tsdfpp
#endif
