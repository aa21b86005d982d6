// Patches place by place. What lies beyond `high` is left empty here.
#include <limits>

#include "mapper/volume/patch_kernels.h"

namespace tsdfpp::plain {
namespace {

std::size_t Number(int i) { return static_cast<std::size_t>(i); }

std::uint32_t& RowAt(PatchRows& rows, int y, int z) { return rows[Number(kPatchSide * z + y)]; }

bool BitAt(const PatchRows& rows, const Index3& place) {
  const std::uint32_t row = rows[Number(kPatchSide * place.z + place.y)];
  return (row >> static_cast<unsigned>(place.x) & 1U) != 0;
}

// The lowest of the eight corners around the i-th point, as a place in the patch.
Index3 LowestCorner(const PulledPoints& points, int i) {
  const std::int32_t corner = points.corner[Number(i)];
  return {corner % kPatchSide, corner / kPatchSide % kPatchSide,
          corner / (kPatchSide * kPatchSide)};
}

float Fraction(const PulledPoints& points, int axis, int i) {
  return points.fraction[Number(axis)][Number(i)];
}

// Calls function(place, block or nullptr, the voxel's place in the block) at every place up to
// `high`.
template <typename Function>
void ForEachPlace(const PatchBlocks& blocks, const PulledPoints& points, const Function& function) {
  const Index3 first = BlockOf(points.low);
  for (int z = 0; z <= points.high.z - points.low.z; ++z) {
    for (int y = 0; y <= points.high.y - points.low.y; ++y) {
      for (int x = 0; x <= points.high.x - points.low.x; ++x) {
        const Index3 voxel = points.low + Index3{x, y, z};
        const Index3 block = BlockOf(voxel);
        const int number = 9 * (block.z - first.z) + 3 * (block.y - first.y) + (block.x - first.x);
        function(Index3{x, y, z}, blocks[Number(number)], PlaceInBlock(voxel));
      }
    }
  }
}

float ValueOf(const TsdfBlock& block, int place, PatchField field) {
  const std::size_t i = Number(place);
  switch (field) {
    case PatchField::kDistance:
      return block.distance[i];
    case PatchField::kWeight:
      return block.weight[i];
    case PatchField::kColourCount:
      return static_cast<float>(block.ColourCount(i));
    case PatchField::kRed:
      return block.FixedColourAt(i)[0];
    case PatchField::kGreen:
      return block.FixedColourAt(i)[1];
    case PatchField::kBlue:
      break;
  }
  return block.FixedColourAt(i)[2];
}

}  // namespace

void PatchBits(const PatchBlocks& blocks, const PulledPoints& points, BlockMask TsdfBlock::*mask,
               PatchRows& rows) {
  rows.fill(0);
  ForEachPlace(blocks, points, [&](const Index3& at, const TsdfBlock* block, int place) {
    if (block == nullptr || !Bit(block->*mask, place)) return;
    RowAt(rows, at.y, at.z) |= 1U << static_cast<unsigned>(at.x);
  });
}

void PatchCubesOf(const PatchRows& observed, const PatchRows& negative, PatchCubes& cubes) {
  cubes.all_observed.fill(0);
  cubes.any_negative.fill(0);
  cubes.crossed.fill(0);
  for (int z = 0; z + 1 < kPatchSide; ++z) {
    for (int y = 0; y + 1 < kPatchSide; ++y) {
      for (int x = 0; x + 1 < kPatchSide; ++x) {
        bool all_observed = true;
        bool any_negative = false;
        bool any_positive = false;
        for (int k = 0; k < 8; ++k) {
          const Index3 corner{x + (k & 1), y + ((k >> 1) & 1), z + (k >> 2)};
          const bool is_observed = BitAt(observed, corner);
          const bool is_negative = BitAt(negative, corner);
          all_observed = all_observed && is_observed;
          any_negative = any_negative || is_negative;
          any_positive = any_positive || (is_observed && !is_negative);
        }
        const std::uint32_t bit = 1U << static_cast<unsigned>(x);
        if (all_observed) RowAt(cubes.all_observed, y, z) |= bit;
        if (any_negative) RowAt(cubes.any_negative, y, z) |= bit;
        if (all_observed && any_negative && any_positive) RowAt(cubes.crossed, y, z) |= bit;
      }
    }
  }
}

BlockMask MarkedAt(const PatchRows& rows, const PulledPoints& points) {
  BlockMask marked{};
  for (int i = 0; i < kBlockVoxels; ++i) {
    if (BitAt(rows, LowestCorner(points, i))) SetBit(marked, i);
  }
  return marked;
}

BlockMask MarkedNearest(const PatchRows& rows, const PulledPoints& points) {
  BlockMask marked{};
  for (int i = 0; i < kBlockVoxels; ++i) {
    const auto upper = [&](int axis) { return Fraction(points, axis, i) >= 0.5F ? 1 : 0; };
    const Index3 nearest = LowestCorner(points, i) + Index3{upper(0), upper(1), upper(2)};
    if (BitAt(rows, nearest)) SetBit(marked, i);
  }
  return marked;
}

BlockMask InMarkedCube(const PatchRows& cubes, const PulledPoints& points) {
  BlockMask marked{};
  for (int i = 0; i < kBlockVoxels; ++i) {
    const Index3 own = LowestCorner(points, i);
    // The cubes below along the axes in which the point lies on a plane hold it as well.
    const auto cubes_along = [&](int axis) { return Fraction(points, axis, i) == 0 ? 2 : 1; };
    for (int z = 0; z < cubes_along(2); ++z) {
      for (int y = 0; y < cubes_along(1); ++y) {
        for (int x = 0; x < cubes_along(0); ++x) {
          if (BitAt(cubes, own + Index3{-x, -y, -z})) SetBit(marked, i);
        }
      }
    }
  }
  return marked;
}

void PatchValuesOf(const PatchBlocks& blocks, const PulledPoints& points, PatchField field,
                   PatchValues& values) {
  values.fill(0);
  ForEachPlace(blocks, points, [&](const Index3& at, const TsdfBlock* block, int place) {
    const bool observed = block != nullptr && Bit(block->observed, place);
    values[Number(kPatchSide * (kPatchSide * at.z + at.y) + at.x)] =
        observed ? ValueOf(*block, place, field) : std::numeric_limits<float>::quiet_NaN();
  });
}

}  // namespace tsdfpp::plain
