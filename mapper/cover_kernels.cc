#include "mapper/cover_kernels.h"

// One pass of this file an instruction set (see fusion_kernels.cc).
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "mapper/cover_kernels.cc"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace tsdfpp::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

// Rows of bits x = -1 ... 8 for y = -1 ... 8 and z = -1 ... 8, 16 rows a slice; beyond the last
// slice there is room for whole vectors.
constexpr std::size_t kStride = 16;
constexpr std::size_t kRows = 10 * kStride;
constexpr std::size_t kRoom = kRows + 2 * kStride + 64;
using Rows = std::array<std::uint16_t, kRoom>;
using Lanes16 = hn::CappedTag<std::uint16_t, 32>;

// Of the rows from `begin` up to `end`, and whole vectors beyond.
void Clear(Rows& rows, std::size_t begin, std::size_t end) {
  const Lanes16 d;
  for (std::size_t i = begin; i < end; i += hn::Lanes(d)) hn::StoreU(hn::Zero(d), d, &rows[i]);
}

// Of the slices that the cubes around these need.
void GatherRows(const MasksAround& around, const SliceRange& slices, Rows& rows) {
  const hn::CappedTag<std::uint16_t, 8> d16;
  const hn::Rebind<std::uint8_t, decltype(d16)> d8;
  for (std::size_t z = slices.first; z <= slices.last + 2; ++z) {
    const std::size_t first = z == 0 ? 0 : (z == 9 ? 18 : 9);
    const std::size_t slice = (z + 7) & 7U;
    std::uint16_t* to = &rows[kStride * z];
    const auto word = [&](std::size_t block) { return (*around[first + block])[slice]; };
    const auto row = [](std::uint64_t left, std::uint64_t own, std::uint64_t right) {
      return static_cast<std::uint16_t>((left & 0xFFU) >> 7U | (own & 0xFFU) << 1U |
                                        (right & 1U) << 9U);
    };
    to[0] = row(word(0) >> 56U, word(1) >> 56U, word(2) >> 56U);
    to[9] = row(word(6), word(7), word(8));
    const std::array<std::uint64_t, 3> words{word(3), word(4), word(5)};
    for (std::size_t y = 0; y < kBlockSide; y += hn::Lanes(d16)) {
      const auto bytes = [&](std::size_t k) {
        return hn::PromoteTo(d16,
                             hn::LoadU(d8, reinterpret_cast<const std::uint8_t*>(&words[k]) + y));
      };
      const auto left = hn::ShiftRight<7>(bytes(0));
      const auto own = hn::ShiftLeft<1>(bytes(1));
      const auto right = hn::ShiftLeft<9>(hn::And(bytes(2), hn::Set(d16, 1)));
      hn::StoreU(hn::Or(left, hn::Or(own, right)), d16, to + 1 + y);
    }
  }
}

// Over a row, the next one, and both of the next slice.
template <class Combine>
auto FourRows(const Rows& rows, std::size_t i, const Combine& combine) {
  const Lanes16 d;
  const auto at = [&](std::size_t k) { return hn::LoadU(d, &rows[i + k]); };
  return combine(combine(at(0), at(1)), combine(at(kStride), at(kStride + 1)));
}

BlockMask Corners(const MasksAround& observed_around, const MasksAround& negative_around,
                  const SliceRange& slices) {
  BlockMask corners{};
  const Lanes16 d;
  // Of the rows that are gathered, and of the cubes between them.
  const std::size_t begin = kStride * slices.first;
  const std::size_t end_of_rows = kStride * (slices.last + 3);
  const std::size_t end_of_cubes = kStride * (slices.last + 2);
  // Vectors read one slice and one row further.
  const std::size_t end_of_reads = end_of_rows + kStride + 1;
  Rows negative;
  Clear(negative, begin, end_of_reads);
  GatherRows(negative_around, slices, negative);
  auto any = hn::Zero(d);
  for (std::size_t i = begin; i < end_of_rows; i += hn::Lanes(d)) {
    any = hn::Or(any, hn::LoadU(d, &negative[i]));
  }
  if (hn::AllTrue(d, hn::Eq(any, hn::Zero(d)))) return corners;
  Rows observed;
  Clear(observed, begin, end_of_reads);
  GatherRows(observed_around, slices, observed);
  Rows positive;
  Clear(positive, begin, end_of_reads);
  for (std::size_t i = begin; i < end_of_rows; i += hn::Lanes(d)) {
    hn::StoreU(hn::AndNot(hn::LoadU(d, &negative[i]), hn::LoadU(d, &observed[i])), d, &positive[i]);
  }
  const auto both = [](auto a, auto b) { return hn::And(a, b); };
  const auto either = [](auto a, auto b) { return hn::Or(a, b); };
  // Bit x of row 16 z + y: whether the cube named by voxel (x - 1, y - 1, z - 1) is crossed.
  Rows crossed;
  Clear(crossed, begin, end_of_reads);
  any = hn::Zero(d);
  const auto nine = hn::Set(d, 0x1FF);
  for (std::size_t i = begin; i < end_of_cubes; i += hn::Lanes(d)) {
    const auto all = FourRows(observed, i, both);
    const auto inside = FourRows(negative, i, either);
    const auto outside = FourRows(positive, i, either);
    const auto cubes = hn::And(hn::And(hn::And(all, hn::ShiftRight<1>(all)), nine),
                               hn::And(hn::Or(inside, hn::ShiftRight<1>(inside)),
                                       hn::Or(outside, hn::ShiftRight<1>(outside))));
    hn::StoreU(cubes, d, &crossed[i]);
    any = hn::Or(any, cubes);
  }
  if (hn::AllTrue(d, hn::Eq(any, hn::Zero(d)))) return corners;
  // A voxel is a corner of the cubes named one lower, and its own, along each axis.
  const hn::CappedTag<std::uint16_t, 8> d16;
  const hn::Rebind<std::uint8_t, decltype(d16)> d8;
  for (std::size_t z = slices.first; z <= slices.last; ++z) {
    for (std::size_t y = 0; y < kBlockSide; y += hn::Lanes(d16)) {
      const auto at = [&](std::size_t k) { return hn::LoadU(d16, &crossed[kStride * z + y + k]); };
      const auto row = hn::Or(hn::Or(at(0), at(1)), hn::Or(at(kStride), at(kStride + 1)));
      const auto bits = hn::And(hn::Or(row, hn::ShiftRight<1>(row)), hn::Set(d16, 0xFF));
      const hn::RebindToSigned<decltype(d16)> ds;
      hn::StoreU(hn::DemoteTo(d8, hn::BitCast(ds, bits)), d8,
                 reinterpret_cast<std::uint8_t*>(&corners[z]) + y);
    }
  }
  return corners;
}

}  // namespace
}  // namespace tsdfpp::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tsdfpp {

HWY_EXPORT(Corners);

namespace {

// The voxels and their neighbours in the block.
BlockMask Widened(const BlockMask& mask) {
  constexpr std::uint64_t kFirstColumn = 0x0101010101010101ULL;
  BlockMask flat;
  for (std::size_t z = 0; z < mask.size(); ++z) {
    const std::uint64_t x =
        mask[z] | (mask[z] & ~(kFirstColumn << 7U)) << 1U | (mask[z] & ~kFirstColumn) >> 1U;
    flat[z] = x | x << 8U | x >> 8U;
  }
  BlockMask wide;
  for (std::size_t z = 0; z < mask.size(); ++z) {
    wide[z] = flat[z] | (z > 0 ? flat[z - 1] : 0) | (z + 1 < mask.size() ? flat[z + 1] : 0);
  }
  return wide;
}

}  // namespace

BlockMask ChangedSigns(const BlockMask& old_observed, const BlockMask& old_negative,
                       const BlockMask& observed, const BlockMask& negative) {
  BlockMask changed;
  BlockMask inside;
  BlockMask outside;
  for (std::size_t z = 0; z < changed.size(); ++z) {
    changed[z] = (old_observed[z] ^ observed[z]) | (old_negative[z] ^ negative[z]);
    inside[z] = old_negative[z] | negative[z];
    outside[z] = (old_observed[z] & ~old_negative[z]) | (observed[z] & ~negative[z]);
  }
  if (!Any(changed)) return changed;
  constexpr std::uint64_t kRim = 0xFF818181818181FFULL;
  const BlockMask near_inside = Widened(inside);
  const BlockMask near_outside = Widened(outside);
  for (std::size_t z = 0; z < changed.size(); ++z) {
    const std::uint64_t rim = z == 0 || z + 1 == changed.size() ? ~0ULL : kRim;
    changed[z] &= rim | (near_inside[z] & near_outside[z]);
  }
  return changed;
}

BlockMask CornersOfCrossedCubes(const MasksAround& observed, const MasksAround& negative,
                                const SliceRange& slices) {
  return HWY_DYNAMIC_DISPATCH(Corners)(observed, negative, slices);
}

}  // namespace tsdfpp
#endif
