#include "mapper/kernels.h"
#include "mapper/volume/cube_masks.h"

// One pass of this file an instruction set (see fusion_kernels_simd.cc).
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "mapper/volume/cube_masks_simd.cc"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace tsdfpp::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

// A lane is a slice.
using Slices = hn::CappedTag<std::uint64_t, kBlockSide>;
using OneSlice = hn::CappedTag<std::uint64_t, 1>;

constexpr std::uint64_t kLastColumn = kFirstColumn << 7U;

// The slices of a block and the one below or above.
using BlockMaskAndOne = std::array<std::uint64_t, kBlockSide + 1>;

// As those of single slices in cube_masks.h.
template <class D, class V>
V AtNextX(D d, V slices, V next) {
  return hn::Or(hn::AndNot(hn::Set(d, kLastColumn), hn::ShiftRight<1>(slices)),
                hn::ShiftLeft<7>(hn::And(next, hn::Set(d, kFirstColumn))));
}
template <class V>
V AtNextY(V slices, V next) {
  return hn::Or(hn::ShiftRight<8>(slices), hn::ShiftLeft<56>(next));
}
template <class D, class V>
V AtLastX(D d, V slices, V last) {
  return hn::Or(hn::AndNot(hn::Set(d, kFirstColumn), hn::ShiftLeft<1>(slices)),
                hn::And(hn::ShiftRight<7>(last), hn::Set(d, kFirstColumn)));
}
template <class V>
V AtLastY(V slices, V last) {
  return hn::Or(hn::ShiftLeft<8>(slices), hn::ShiftRight<56>(last));
}

// For the cubes named by the voxels of slices 0 ... 8: their four lower corners' bits, joined.
template <class Join>
void JoinFour(const UpperMasks& masks, const Join& join, BlockMaskAndOne& joined) {
  const auto join_at = [&](auto d, std::size_t block, std::size_t z, std::size_t to) {
    const auto at = [&](std::size_t step) { return hn::LoadU(d, &(*masks[block + step])[z]); };
    const auto rows = join(at(0), AtNextX(d, at(0), at(1)));
    const auto next_rows = join(at(2), AtNextX(d, at(2), at(3)));
    hn::StoreU(join(rows, AtNextY(rows, next_rows)), d, &joined[to]);
  };
  const Slices d;
  for (std::size_t z = 0; z < kBlockSide; z += hn::Lanes(d)) join_at(d, 0, z, z);
  join_at(OneSlice(), 4, 0, kBlockSide);
}

CubeMasks CubesOf(const UpperMasks& observed, const UpperMasks& negative) {
  const auto both = [](auto a, auto b) { return hn::And(a, b); };
  const auto either = [](auto a, auto b) { return hn::Or(a, b); };
  BlockMaskAndOne complete;
  BlockMaskAndOne any;
  BlockMaskAndOne all;
  JoinFour(observed, both, complete);
  JoinFour(negative, either, any);
  JoinFour(negative, both, all);
  const Slices d;
  CubeMasks cubes;
  for (std::size_t z = 0; z < kBlockSide; z += hn::Lanes(d)) {
    const auto of_both = [&](const BlockMaskAndOne& of, const auto& join) {
      return join(hn::LoadU(d, &of[z]), hn::LoadU(d, &of[z + 1]));
    };
    const auto whole = of_both(complete, both);
    const auto crossed = hn::AndNot(of_both(all, both), hn::And(whole, of_both(any, either)));
    hn::StoreU(whole, d, &cubes.complete[z]);
    hn::StoreU(crossed, d, &cubes.crossed[z]);
  }
  return cubes;
}

BlockMask CornersOf(const LowerMasks& cubes) {
  // Of the cubes of slices -1 ... 7: four corners each.
  BlockMaskAndOne corners;
  const auto spread_at = [&](auto d, std::size_t block, std::size_t z, std::size_t to) {
    const auto at = [&](std::size_t step) { return hn::LoadU(d, &(*cubes[block + step])[z]); };
    const auto rows = hn::Or(at(0), AtLastX(d, at(0), at(1)));
    const auto rows_before = hn::Or(at(2), AtLastX(d, at(2), at(3)));
    hn::StoreU(hn::Or(rows, AtLastY(rows, rows_before)), d, &corners[to]);
  };
  const Slices d;
  spread_at(OneSlice(), 4, kBlockSide - 1, 0);
  for (std::size_t z = 0; z < kBlockSide; z += hn::Lanes(d)) spread_at(d, 0, z, z + 1);
  BlockMask both;
  for (std::size_t z = 0; z < kBlockSide; z += hn::Lanes(d)) {
    hn::StoreU(hn::Or(hn::LoadU(d, &corners[z]), hn::LoadU(d, &corners[z + 1])), d, &both[z]);
  }
  return both;
}

// The voxels and their neighbours in the block.
void Widen(BlockMask& mask) {
  const Slices d;
  std::array<std::uint64_t, kBlockSide + 2> flat{};  // slices -1 ... 8
  for (std::size_t z = 0; z < kBlockSide; z += hn::Lanes(d)) {
    const auto own = hn::LoadU(d, &mask[z]);
    const auto none = hn::Zero(d);
    const auto x = hn::Or(own, hn::Or(AtNextX(d, own, none), AtLastX(d, own, none)));
    const auto xy = hn::Or(x, hn::Or(hn::ShiftLeft<8>(x), hn::ShiftRight<8>(x)));
    hn::StoreU(xy, d, &flat[z + 1]);
  }
  for (std::size_t z = 0; z < kBlockSide; z += hn::Lanes(d)) {
    const auto at = [&](std::size_t k) { return hn::LoadU(d, &flat[z + k]); };
    hn::StoreU(hn::Or(at(1), hn::Or(at(0), at(2))), d, &mask[z]);
  }
}

BlockMask Changed(const BlockMask& old_observed, const BlockMask& old_negative,
                  const BlockMask& observed, const BlockMask& negative) {
  const Slices d;
  BlockMask changed;
  BlockMask inside;
  BlockMask outside;
  auto any = hn::Zero(d);
  for (std::size_t z = 0; z < kBlockSide; z += hn::Lanes(d)) {
    const auto at = [&](const BlockMask& mask) { return hn::LoadU(d, &mask[z]); };
    const auto differs =
        hn::Or(hn::Xor(at(old_observed), at(observed)), hn::Xor(at(old_negative), at(negative)));
    any = hn::Or(any, differs);
    hn::StoreU(differs, d, &changed[z]);
    hn::StoreU(hn::Or(at(old_negative), at(negative)), d, &inside[z]);
    hn::StoreU(hn::Or(hn::AndNot(at(old_negative), at(old_observed)),
                      hn::AndNot(at(negative), at(observed))),
               d, &outside[z]);
  }
  if (hn::AllTrue(d, hn::Eq(any, hn::Zero(d)))) return changed;
  constexpr std::uint64_t kRim = 0xFF818181818181FFULL;
  constexpr BlockMask kRims{~0ULL, kRim, kRim, kRim, kRim, kRim, kRim, ~0ULL};
  Widen(inside);
  Widen(outside);
  for (std::size_t z = 0; z < kBlockSide; z += hn::Lanes(d)) {
    const auto at = [&](const BlockMask& mask) { return hn::LoadU(d, &mask[z]); };
    const auto matters = hn::Or(at(kRims), hn::And(at(inside), at(outside)));
    hn::StoreU(hn::And(at(changed), matters), d, &changed[z]);
  }
  return changed;
}

}  // namespace
}  // namespace tsdfpp::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tsdfpp {

HWY_EXPORT(CubesOf);
HWY_EXPORT(CornersOf);
HWY_EXPORT(Changed);

CubeMasks FindCubeMasks(const UpperMasks& observed, const UpperMasks& negative) {
  const auto run = UsesPlainKernels() ? plain::FindCubeMasks : HWY_DYNAMIC_DISPATCH(CubesOf);
  return run(observed, negative);
}

BlockMask CornersOfCubes(const LowerMasks& cubes) {
  const auto run = UsesPlainKernels() ? plain::CornersOfCubes : HWY_DYNAMIC_DISPATCH(CornersOf);
  return run(cubes);
}

BlockMask ChangedSigns(const BlockMask& old_observed, const BlockMask& old_negative,
                       const BlockMask& observed, const BlockMask& negative) {
  const auto run = UsesPlainKernels() ? plain::ChangedSigns : HWY_DYNAMIC_DISPATCH(Changed);
  return run(old_observed, old_negative, observed, negative);
}

}  // namespace tsdfpp
#endif
