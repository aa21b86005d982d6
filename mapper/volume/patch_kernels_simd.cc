#include <limits>

#include "mapper/kernels.h"
#include "mapper/volume/patch_kernels.h"

// One pass of this file an instruction set (see fusion_kernels_simd.cc).
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "mapper/volume/patch_kernels_simd.cc"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include "mapper/volume/half_lanes-inl.h"
#include "mapper/volume/mask_lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tsdfpp::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

using Words = hn::CappedTag<std::uint32_t, 16>;
using Ints = hn::RebindToSigned<Words>;
using Floats = hn::Rebind<float, Words>;
constexpr std::size_t kSide = kPatchSide;
constexpr std::size_t kRows = kSide * kSide;
static_assert(kPatchSide == 16);  // shifts by 4 and 8

std::size_t Place(int i) { return static_cast<std::size_t>(i); }

void Bits(const PatchBlocks& blocks, const PulledPoints& points, BlockMask TsdfBlock::*mask,
          PatchRows& rows) {
  const hn::CappedTag<std::uint32_t, kBlockSide> d;
  const hn::Rebind<std::uint8_t, decltype(d)> d8;
  const int first_x = points.low.x & 7;
  const auto first_y = Place(points.low.y & 7);
  const int first_z = points.low.z & 7;
  const std::size_t count_z = Place(points.high.z - points.low.z) + 1;
  // The 24 rows of three blocks, of which the patch has 16.
  HWY_ALIGN std::array<std::uint32_t, 3 * kBlockSide> slice;
  for (std::size_t z = 0; z < count_z; ++z) {
    const int at_z = first_z + static_cast<int>(z);
    for (std::size_t by = 0; by < 3; ++by) {
      const TsdfBlock* const* row = &blocks[Place(9 * (at_z >> 3)) + 3 * by];
      std::array<std::uint64_t, 3> words;
      for (std::size_t bx = 0; bx < 3; ++bx) {
        words[bx] = row[bx] == nullptr ? 0 : (row[bx]->*mask)[Place(at_z & 7)];
      }
      for (std::size_t y = 0; y < kBlockSide; y += hn::Lanes(d)) {
        const auto bytes = [&](std::size_t k) {
          const auto* of = reinterpret_cast<const std::uint8_t*>(&words[k]);
          return hn::PromoteTo(d, hn::LoadU(d8, of + y));
        };
        const auto all =
            hn::Or(bytes(0), hn::Or(hn::ShiftLeft<8>(bytes(1)), hn::ShiftLeft<16>(bytes(2))));
        const auto own = hn::And(hn::ShiftRightSame(all, first_x), hn::Set(d, 0xFFFFU));
        hn::Store(own, d, &slice[kBlockSide * by + y]);
      }
    }
    for (std::size_t y = 0; y < kSide; y += hn::Lanes(d)) {
      hn::StoreU(hn::LoadU(d, &slice[first_y + y]), d, &rows[kSide * z + y]);
    }
  }
  std::fill(rows.begin() + static_cast<std::ptrdiff_t>(kSide * count_z), rows.end(), 0U);
}

void Cubes(const PatchRows& observed, const PatchRows& negative, PatchCubes& cubes) {
  const Words d;
  const auto four = [d](const PatchRows& rows, std::size_t i, const auto& combine) {
    const auto at = [&](std::size_t k) { return hn::LoadU(d, &rows[i + k]); };
    const auto along_x = combine(combine(at(0), at(1)), combine(at(kSide), at(kSide + 1)));
    return combine(along_x, hn::ShiftRight<1>(along_x));
  };
  const auto both = [](auto a, auto b) { return hn::And(a, b); };
  const auto either = [](auto a, auto b) { return hn::Or(a, b); };
  PatchRows positive;
  for (std::size_t i = 0; i < kRows + 2 * kSide; i += hn::Lanes(d)) {
    hn::StoreU(hn::AndNot(hn::LoadU(d, &negative[i]), hn::LoadU(d, &observed[i])), d, &positive[i]);
  }
  for (std::size_t i = 0; i < kRows; i += hn::Lanes(d)) {
    const auto all = four(observed, i, both);
    const auto inside = four(negative, i, either);
    const auto outside = four(positive, i, either);
    hn::StoreU(all, d, &cubes.all_observed[i]);
    hn::StoreU(inside, d, &cubes.any_negative[i]);
    hn::StoreU(hn::And(all, hn::And(inside, outside)), d, &cubes.crossed[i]);
  }
}

// The rows' words at these rows.
hn::VFromD<Ints> RowsAt(const PatchRows& rows, hn::VFromD<Ints> row) {
  return hn::GatherIndex(Ints(), reinterpret_cast<const std::int32_t*>(rows.data()), row);
}

hn::VFromD<Ints> BitAt(hn::VFromD<Ints> word, hn::VFromD<Ints> x) {
  const Words d;
  const auto bit = hn::Shr(hn::BitCast(d, word), hn::BitCast(d, x));
  return hn::And(hn::BitCast(Ints(), bit), hn::Set(Ints(), 1));
}

template <class Function>
BlockMask MaskOfPoints(const Function& bits_of) {
  const Ints d;
  BlockMask mask{};
  auto* bytes = reinterpret_cast<std::uint8_t*>(mask.data());
  for (std::size_t i = 0; i < kBlockVoxels; i += hn::Lanes(d)) {
    PutBits(d, hn::Ne(bits_of(i), hn::Zero(d)), i, bytes);
  }
  return mask;
}

BlockMask Marked(const PatchRows& rows, const PulledPoints& points) {
  const Ints d;
  return MaskOfPoints([&](std::size_t i) {
    const auto place = hn::LoadU(d, &points.corner[i]);
    return BitAt(RowsAt(rows, hn::ShiftRight<4>(place)), hn::And(place, hn::Set(d, 15)));
  });
}

BlockMask Nearest(const PatchRows& rows, const PulledPoints& points) {
  const Ints d;
  const Floats df;
  return MaskOfPoints([&](std::size_t i) {
    const auto upper = [&](std::size_t axis, int step) {
      const auto fraction = hn::LoadU(df, &points.fraction[axis][i]);
      return hn::IfThenElseZero(hn::RebindMask(d, hn::Ge(fraction, hn::Set(df, 0.5F))),
                                hn::Set(d, step));
    };
    const auto corner = hn::LoadU(d, &points.corner[i]);
    const auto place = hn::Add(hn::Add(corner, upper(0, 1)),
                               hn::Add(upper(1, kPatchSide), upper(2, kPatchSide * kPatchSide)));
    return BitAt(RowsAt(rows, hn::ShiftRight<4>(place)), hn::And(place, hn::Set(d, 15)));
  });
}

BlockMask InCubes(const PatchRows& cubes, const PulledPoints& points) {
  const Ints d;
  const Floats df;
  return MaskOfPoints([&](std::size_t i) {
    const auto on_plane = [&](std::size_t axis) {
      return hn::RebindMask(d, hn::Eq(hn::LoadU(df, &points.fraction[axis][i]), hn::Zero(df)));
    };
    const auto place = hn::LoadU(d, &points.corner[i]);
    const auto row = hn::ShiftRight<4>(place);
    const auto x = hn::And(place, hn::Set(d, 15));
    const auto on_y = on_plane(1);
    const auto on_z = on_plane(2);
    auto word = RowsAt(cubes, row);
    const auto add = [&](auto mask, int rows_below) {
      if (hn::AllFalse(d, mask)) return;
      const auto below = RowsAt(cubes, hn::Sub(row, hn::Set(d, rows_below)));
      word = hn::Or(word, hn::IfThenElseZero(mask, below));
    };
    add(on_y, 1);
    add(on_z, kPatchSide);
    add(hn::And(on_y, on_z), kPatchSide + 1);
    const auto below = BitAt(word, hn::Sub(x, hn::Set(d, 1)));
    return hn::Or(BitAt(word, x), hn::IfThenElseZero(on_plane(0), below));
  });
}

// load(d, block, i) are eight values of a block as floats, from voxel i on; nothing is asked of a
// block that lacks what `has(block)` asks for, where all values are 0.
template <class Has, class Load>
void Values(const PatchBlocks& blocks, const PulledPoints& points, const Has& has, const Load& load,
            PatchValues& values) {
  const hn::CappedTag<float, kBlockSide> d;
  const auto unobserved = hn::Set(d, std::numeric_limits<float>::quiet_NaN());
  const int first_x = points.low.x & 7;
  const int first_y = points.low.y & 7;
  const int first_z = points.low.z & 7;
  const int count_y = points.high.y - points.low.y + 1;
  const int count_z = points.high.z - points.low.z + 1;
  const auto blocks_x = Place((first_x + points.high.x - points.low.x) >> 3) + 1;
  for (int z = 0; z < count_z; ++z) {
    for (int y = 0; y < count_y; ++y) {
      const int at_y = first_y + y;
      const int at_z = first_z + z;
      const TsdfBlock* const* row = &blocks[Place(9 * (at_z >> 3) + 3 * (at_y >> 3))];
      const std::size_t in_block = Place(64 * (at_z & 7) + 8 * (at_y & 7));
      float* to = &values[kSide * (kSide * Place(z) + Place(y))];
      for (std::size_t bx = 0; bx < blocks_x; ++bx) {
        const TsdfBlock* block = row[bx];
        const auto observed =
            block == nullptr
                ? 0U
                : static_cast<unsigned>(block->observed[Place(at_z & 7)] >> (8 * (at_y & 7))) &
                      0xFFU;
        const bool is_there = block != nullptr && has(*block);
        for (std::size_t k = 0; k < kBlockSide; k += hn::Lanes(d)) {
          const auto bits = static_cast<std::uint8_t>(observed >> k);
          std::array<std::uint8_t, 8> mask{bits};
          const auto known = hn::LoadMaskBits(d, mask.data());
          const auto own = hn::IfThenElse(
              known, is_there ? load(d, *block, in_block + k) : hn::Zero(d), unobserved);
          // The row's beginning cuts its first block; what is too much at an end is overwritten by
          // the next block or row, or means nothing.
          const int column = static_cast<int>(kBlockSide * bx + k) - first_x;
          if (column >= 0) {
            hn::StoreU(own, d, to + column);
          } else if (column > -static_cast<int>(hn::Lanes(d))) {
            const hn::RebindToSigned<decltype(d)> di;
            const auto lane = hn::And(hn::Add(hn::Iota(di, 0), hn::Set(di, -column)),
                                      hn::Set(di, static_cast<int>(hn::Lanes(d)) - 1));
            hn::StoreU(hn::TableLookupLanes(own, hn::IndicesFromVec(d, lane)), d, to);
          }
        }
      }
    }
  }
}

void FieldValues(const PatchBlocks& blocks, const PulledPoints& points, PatchField field,
                 PatchValues& values) {
  const auto any = [](const TsdfBlock&) { return true; };
  const auto coloured = [](const TsdfBlock& block) { return block.HasColours(); };
  const auto bytes = [](auto d, const std::uint8_t* from) {
    const hn::Rebind<std::uint8_t, decltype(d)> d8;
    const hn::Rebind<std::int32_t, decltype(d)> di;
    return hn::ConvertTo(d, hn::PromoteTo(di, hn::LoadU(d8, from)));
  };
  switch (field) {
    case PatchField::kDistance:
      Values(
          blocks, points, any,
          [](auto d, const TsdfBlock& block, std::size_t i) {
            return LoadHalves(d, &block.distance[i]);
          },
          values);
      return;
    case PatchField::kWeight:
      Values(
          blocks, points, any,
          [&](auto d, const TsdfBlock& block, std::size_t i) { return bytes(d, &block.weight[i]); },
          values);
      return;
    case PatchField::kColourCount:
      Values(
          blocks, points, coloured,
          [&](auto d, const TsdfBlock& block, std::size_t i) {
            const auto& slice = block.colours[i / kSliceVoxels];
            return slice == nullptr ? hn::Zero(d) : bytes(d, &slice->count[i % kSliceVoxels]);
          },
          values);
      return;
    case PatchField::kRed:
    case PatchField::kGreen:
    case PatchField::kBlue:
      break;
  }
  const std::size_t channel = field == PatchField::kRed ? 0 : field == PatchField::kGreen ? 1 : 2;
  Values(
      blocks, points, coloured,
      [channel](auto d, const TsdfBlock& block, std::size_t i) {
        const hn::Rebind<std::uint16_t, decltype(d)> d16;
        const hn::Rebind<std::int32_t, decltype(d)> di;
        const auto& slice = block.colours[i / kSliceVoxels];
        if (slice == nullptr) return hn::Zero(d);
        const std::uint16_t* from = &slice->channel[channel][i % kSliceVoxels];
        return hn::ConvertTo(d, hn::PromoteTo(di, hn::LoadU(d16, from)));
      },
      values);
}

}  // namespace
}  // namespace tsdfpp::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tsdfpp {

HWY_EXPORT(Bits);
HWY_EXPORT(Cubes);
HWY_EXPORT(Marked);
HWY_EXPORT(Nearest);
HWY_EXPORT(InCubes);
HWY_EXPORT(FieldValues);

void PatchBits(const PatchBlocks& blocks, const PulledPoints& points, BlockMask TsdfBlock::*mask,
               PatchRows& rows) {
  const auto run = UsesPlainKernels() ? plain::PatchBits : HWY_DYNAMIC_DISPATCH(Bits);
  run(blocks, points, mask, rows);
}

void PatchCubesOf(const PatchRows& observed, const PatchRows& negative, PatchCubes& cubes) {
  const auto run = UsesPlainKernels() ? plain::PatchCubesOf : HWY_DYNAMIC_DISPATCH(Cubes);
  run(observed, negative, cubes);
}

BlockMask MarkedAt(const PatchRows& rows, const PulledPoints& points) {
  const auto run = UsesPlainKernels() ? plain::MarkedAt : HWY_DYNAMIC_DISPATCH(Marked);
  return run(rows, points);
}

BlockMask MarkedNearest(const PatchRows& rows, const PulledPoints& points) {
  const auto run = UsesPlainKernels() ? plain::MarkedNearest : HWY_DYNAMIC_DISPATCH(Nearest);
  return run(rows, points);
}

BlockMask InMarkedCube(const PatchRows& cubes, const PulledPoints& points) {
  const auto run = UsesPlainKernels() ? plain::InMarkedCube : HWY_DYNAMIC_DISPATCH(InCubes);
  return run(cubes, points);
}

void PatchValuesOf(const PatchBlocks& blocks, const PulledPoints& points, PatchField field,
                   PatchValues& values) {
  const auto run = UsesPlainKernels() ? plain::PatchValuesOf : HWY_DYNAMIC_DISPATCH(FieldValues);
  run(blocks, points, field, values);
}

}  // namespace tsdfpp
#endif
