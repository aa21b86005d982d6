#include "mapper/index_kernels.h"

#include <bit>

// One pass of this file an instruction set (see fusion_kernels.cc).
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "mapper/index_kernels.cc"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include "mapper/mask_lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tsdfpp::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

using Ints = hn::CappedTag<std::int32_t, 16>;
using Shorts = hn::Rebind<std::uint16_t, Ints>;
using Floats = hn::Rebind<float, Ints>;

VotesCounted Votes(const BlockMask& votes, InstanceId id, int confidence_cap, ListEntry* active) {
  static_assert(sizeof(ListEntry) == 4 && std::endian::native == std::endian::little);
  const Ints di;
  const auto* bits = reinterpret_cast<const std::uint8_t*>(votes.data());
  VotesCounted counted;
  auto* other_bits = reinterpret_cast<std::uint8_t*>(counted.others.data());
  auto* saturated_bits = reinterpret_cast<std::uint8_t*>(counted.saturated.data());
  const auto wanted = hn::Set(di, id);
  const auto cap = hn::Set(di, confidence_cap);
  for (std::size_t i = 0; i < kBlockVoxels; i += hn::Lanes(di)) {
    const auto voting = MaskAt(di, bits, i);
    if (hn::AllFalse(di, voting)) continue;
    auto* entries = reinterpret_cast<std::int32_t*>(active + i);
    const auto entry = hn::LoadU(di, entries);
    const auto same = hn::Eq(hn::And(entry, hn::Set(di, 0xFFFF)), wanted);
    const auto below = hn::Lt(hn::ShiftRight<16>(entry), cap);
    const auto raised = hn::And(voting, hn::And(same, below));
    if (!hn::AllFalse(di, raised)) {  // else the memory need not be written
      const auto more = hn::Add(entry, hn::Set(di, 1 << 16));
      hn::StoreU(hn::IfThenElse(raised, more, entry), di, entries);
    }
    PutBits(di, hn::AndNot(same, voting), i, other_bits);
    const auto full =
        hn::Gt(hn::Add(hn::ShiftRight<16>(entry), hn::Set(di, 1)), hn::Sub(cap, hn::Set(di, 1)));
    PutBits(di, hn::And(voting, hn::And(same, full)), i, saturated_bits);
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
    for (int layer = 0; layer < lists.layers; ++layer) {
      const std::size_t at = static_cast<std::size_t>(layer) * kBlockVoxels + i;
      const auto other_d = hn::LoadU(df, lists.distance + at);
      const auto other_o = hn::PromoteTo(di, hn::LoadU(du, lists.id + at));
      const auto swap = hn::And(carried, hn::Lt(d, other_d));
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
                           ListEntry* active) {
  return HWY_DYNAMIC_DISPATCH(Votes)(votes, id, confidence_cap, active);
}

void ListAlone(const BlockMask& covered, InstanceId id, InstanceId* ids) {
  HWY_DYNAMIC_DISPATCH(Alone)(covered, id, ids);
}

void InsertByDistance(const BlockMask& covered, const float* distance, InstanceId id,
                      const OrderedLists& lists) {
  HWY_DYNAMIC_DISPATCH(Insert)(covered, distance, id, lists);
}

}  // namespace tsdfpp
#endif
