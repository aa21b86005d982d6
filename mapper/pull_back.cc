#include "mapper/pull_back.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <limits>

#include "mapper/cube_rows.h"

namespace tsdfpp {
namespace {

constexpr std::size_t kBlocksPerTask = 8;
constexpr float kUnobserved = std::numeric_limits<float>::quiet_NaN();

std::size_t At(int i) { return static_cast<std::size_t>(i); }

// Rows of a patch as bits: place x is bit x of row [z][y].
using PatchBits = std::array<std::array<std::uint16_t, kPatchSide>, kPatchSide>;

// The blocks that a patch cuts: at most three along each axis.
class PatchBlocks {
 public:
  PatchBlocks(const VoxelReader& reader, const PulledPoints& points)
      : low_(points.low), high_(points.high), first_(BlockOf(points.low)) {
    const Index3 last = BlockOf(points.high);
    for (int z = 0; z <= last.z - first_.z; ++z) {
      for (int y = 0; y <= last.y - first_.y; ++y) {
        for (int x = 0; x <= last.x - first_.x; ++x) {
          const TsdfBlock* block = reader.BlockAt(first_ + Index3{x, y, z});
          blocks_[At(9 * z + 3 * y + x)] = block;
          any_ = any_ || block != nullptr;
          any_negative_ = any_negative_ || (block != nullptr && block->AnyNegative());
        }
      }
    }
  }

  bool any() const { return any_; }
  bool any_negative() const { return any_negative_; }

  // function(block or nullptr, place in the block, place in the patch, voxels in the row), for the
  // pieces of rows that lie in one block each.
  template <typename Function>
  void ForEachPiece(const Function& function) const {
    for (int z = low_.z; z <= high_.z; ++z) {
      for (int y = low_.y; y <= high_.y; ++y) {
        const int row = 9 * ((z >> 3) - first_.z) + 3 * ((y >> 3) - first_.y);
        const int patch_row = ((z - low_.z) * kPatchSide + (y - low_.y)) * kPatchSide;
        for (int x = low_.x; x <= high_.x;) {
          const int end = std::min(high_.x, x | 7) + 1;
          function(blocks_[At(row + (x >> 3) - first_.x)], PlaceInBlock({x, y, z}),
                   patch_row + (x - low_.x), end - x);
          x = end;
        }
      }
    }
  }

  // value(block, i) at observed voxels, NaN elsewhere.
  template <typename Value>
  void Fill(const Value& value, PatchValues& out) const {
    ForEachPiece([&](const TsdfBlock* block, int place, int to, int count) {
      for (int k = 0; k < count; ++k) {
        const std::size_t i = At(place + k);
        out[At(to + k)] = block != nullptr && block->weight[i] > 0 ? value(*block, i) : kUnobserved;
      }
    });
  }

  bool any_coloured() const {
    return std::any_of(blocks_.begin(), blocks_.end(), [](const TsdfBlock* block) {
      return block != nullptr && block->colours != nullptr;
    });
  }

  PatchBits Bits(BlockMask TsdfBlock::*mask) const {
    PatchBits bits{};
    ForEachPiece([&](const TsdfBlock* block, int place, int to, int count) {
      if (block == nullptr) return;
      const auto piece = static_cast<unsigned>(
          ((block->*mask)[At(place >> 6)] >> static_cast<unsigned>(place & 63)) &
          ((1U << static_cast<unsigned>(count)) - 1U));
      auto& row = bits[At(to >> 8)][At((to >> 4) & 15)];
      row = static_cast<std::uint16_t>(row | (piece << static_cast<unsigned>(to & 15)));
    });
    return bits;
  }

 private:
  Index3 low_;
  Index3 high_;
  Index3 first_;
  std::array<const TsdfBlock*, 27> blocks_{};
  bool any_ = false;
  bool any_negative_ = false;
};

bool BitAt(const PatchBits& bits, std::int32_t place) {
  return ((bits[At(place >> 8)][At((place >> 4) & 15)] >> static_cast<unsigned>(place & 15)) &
          1U) != 0;
}

// Bit x of row [z][y]: over the eight corners of the cube whose lowest corner is there.
struct CubeBits {
  PatchBits crossed{};
  PatchBits any_negative{};
};

CubeBits CubesOf(const PatchBits& observed, const PatchBits& negative) {
  CubeBits cubes;
  for (std::size_t z = 0; z + 1 < kPatchSide; ++z) {
    for (std::size_t y = 0; y + 1 < kPatchSide; ++y) {
      const CubeRow row = CubeRowOf(observed, negative, z, y);
      cubes.crossed[z][y] = static_cast<std::uint16_t>(row.crossed());
      cubes.any_negative[z][y] = static_cast<std::uint16_t>(row.any_negative);
    }
  }
  return cubes;
}

// A point on a plane of the lattice lies in the cubes on both sides of it.
bool InCrossedCube(const PatchBits& crossed, const PulledPoints& points, std::size_t i) {
  const std::int32_t place = points.corner[i];
  const auto lowest = [&](std::size_t axis) { return points.fraction[axis][i] == 0 ? -1 : 0; };
  for (int dz = lowest(2); dz <= 0; ++dz) {
    for (int dy = lowest(1); dy <= 0; ++dy) {
      for (int dx = lowest(0); dx <= 0; ++dx) {
        if (BitAt(crossed, place + 256 * dz + 16 * dy + dx)) return true;
      }
    }
  }
  return false;
}

bool AllEight(const PatchBits& bits, std::int32_t place) {
  const auto z = At(place >> 8);
  const auto y = At((place >> 4) & 15);
  const std::uint32_t all =
      bits[z][y] & bits[z][y + 1] & bits[z + 1][y] & static_cast<std::uint32_t>(bits[z + 1][y + 1]);
  return (all >> static_cast<unsigned>(place & 15) & 3U) == 3U;
}

// The patch's place of the corner nearest to point i.
std::int32_t NearestCorner(const PulledPoints& points, std::size_t i) {
  const auto upper = [&](std::size_t axis) { return points.fraction[axis][i] >= 0.5F ? 1 : 0; };
  return points.corner[i] + 256 * upper(2) + 16 * upper(1) + upper(0);
}

// Takes each point to its nearest corner.
void RoundFractions(PulledPoints& points) {
  for (auto& fractions : points.fraction) {
    for (float& fraction : fractions) fraction = fraction >= 0.5F ? 1.0F : 0.0F;
  }
}

PulledPoints PointsOf(const std::array<double, 12>& T, double voxel_m, const Index3& block) {
  PulledPoints points;
  PullBackPoints(T, voxel_m, {block.x * kBlockSide, block.y * kBlockSide, block.z * kBlockSide},
                 points);
  return points;
}

}  // namespace

std::array<double, 12> RowsOf(const Pose& T) {
  std::array<double, 12> rows{};
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 4; ++c) rows[At(4 * r + c)] = T.matrix()(r, c);
  }
  return rows;
}

bool CoverOfBlock(const VoxelReader& reader, const std::array<double, 12>& T_LW, double voxel_m,
                  float back, const Index3& index, PulledCover& out) {
  const PulledPoints points = PointsOf(T_LW, voxel_m, index);
  const PatchBlocks blocks(reader, points);
  if (!blocks.any_negative()) return false;
  const CubeBits cubes =
      CubesOf(blocks.Bits(&TsdfBlock::observed), blocks.Bits(&TsdfBlock::negative));
  // Both conditions of a cover need a negative corner, in the point's own cube unless the point
  // lies on a plane: then one of the cubes around it, and its own cube's lower corners are among
  // theirs.
  Lanes candidate;
  bool any = false;
  for (std::size_t i = 0; i < kBlockVoxels; ++i) {
    candidate[i] =
        BitAt(cubes.any_negative, points.corner[i]) || InCrossedCube(cubes.crossed, points, i) ? -1
                                                                                               : 0;
    any = any || candidate[i] != 0;
  }
  if (!any) return false;
  PatchValues values;
  blocks.Fill([](const TsdfBlock& block, std::size_t i) { return float{block.distance[i]}; },
              values);
  InterpolateCounted(values, points, candidate.data(), out.distance.data());
  any = false;
  out.covered = {};
  for (std::size_t i = 0; i < kBlockVoxels; ++i) {
    const float distance = candidate[i] != 0 ? out.distance[i] : kUnobserved;
    const bool defined = distance == distance;
    const bool covers =
        defined && ((distance < 0 && distance >= -back) || InCrossedCube(cubes.crossed, points, i));
    if (covers) SetBit(out.covered, static_cast<int>(i));
    any = any || covers;
  }
  return any;
}

bool ResampleBlock(const VoxelReader& reader, const std::array<double, 12>& T_inverse,
                   double voxel_m, const Index3& index, TsdfBlock& out, Resampling resampling) {
  PulledPoints points = PointsOf(T_inverse, voxel_m, index);
  const PatchBlocks blocks(reader, points);
  if (!blocks.any()) return false;
  const PatchBits observed = blocks.Bits(&TsdfBlock::observed);
  const bool all_count = resampling == Resampling::kAll;
  const bool nearest = resampling == Resampling::kNearest;
  // At the nearest corner itself, the only one that then counts.
  if (nearest) RoundFractions(points);
  const auto interpolate = all_count ? InterpolateAll
                           : nearest ? InterpolateCounted
                                     : InterpolateObserved;
  Lanes wanted;
  bool any = false;
  for (std::size_t i = 0; i < kBlockVoxels; ++i) {
    const bool written = all_count ? AllEight(observed, points.corner[i])
                                   : BitAt(observed, NearestCorner(points, i));
    wanted[i] = written ? -1 : 0;
    any = any || written;
  }
  if (!any) return false;
  PatchValues values;
  blocks.Fill([](const TsdfBlock& block, std::size_t i) { return float{block.distance[i]}; },
              values);
  std::array<float, kBlockVoxels> distance;
  interpolate(values, points, wanted.data(), distance.data());
  blocks.Fill(
      [](const TsdfBlock& block, std::size_t i) { return static_cast<float>(block.weight[i]); },
      values);
  std::array<float, kBlockVoxels> weight{};
  interpolate(values, points, wanted.data(), weight.data());
  PatchValues counts;
  blocks.Fill([](const TsdfBlock& block,
                 std::size_t i) { return static_cast<float>(block.ColourCount(i)); },
              counts);
  std::array<float, kBlockVoxels> count{};
  std::array<float, kBlockVoxels> total{};
  interpolate(counts, points, wanted.data(), count.data());
  for (std::size_t i = 0; i < kBlockVoxels; ++i) {
    out.distance[i] = wanted[i] != 0 ? distance[i] : 0;
    out.weight[i] = wanted[i] != 0 ? static_cast<std::uint8_t>(weight[i] + 0.5F) : 0;
  }
  if (!blocks.any_coloured()) return true;
  std::array<PatchValues, 3> channels;
  for (std::size_t channel = 0; channel < 3; ++channel) {
    blocks.Fill(
        [channel](const TsdfBlock& block, std::size_t i) {
          return block.colours == nullptr ? 0.0F
                                          : static_cast<float>(block.colours->channel[channel][i]);
        },
        channels[channel]);
  }
  BlockColours& colours = out.MakeColours();
  InterpolateColours(
      channels, counts, points, wanted.data(),
      {colours.channel[0].data(), colours.channel[1].data(), colours.channel[2].data()},
      total.data());
  for (std::size_t i = 0; i < kBlockVoxels; ++i) {
    const bool coloured = wanted[i] != 0 && total[i] > 0;
    colours.count[i] = coloured ? static_cast<std::uint8_t>(count[i] + 0.5F) : 0;
    for (auto& channel : colours.channel) channel[i] = colours.count[i] > 0 ? channel[i] : 0;
  }
  return true;
}

TsdfGrid ResampleGrid(const TsdfGrid& grid, const Pose& T_rel, double voxel_m, float back,
                      Resampling resampling) {
  const VoxelReader reader(grid);
  const std::vector<Index3> candidates = BlocksTouchedBy(reader, T_rel, voxel_m);
  std::vector<std::unique_ptr<TsdfBlock>> made(candidates.size());
  const std::array<double, 12> T_inverse = RowsOf(T_rel.inverse());
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, candidates.size(), kBlocksPerTask),
      [&](const tbb::blocked_range<std::size_t>& range) {
        for (std::size_t i = range.begin(); i != range.end(); ++i) {
          auto block = std::make_unique<TsdfBlock>();
          if (!ResampleBlock(reader, T_inverse, voxel_m, candidates[i], *block, resampling)) {
            continue;
          }
          block->UpdateMasks(back);
          made[i] = std::move(block);
        }
      },
      tbb::simple_partitioner());
  TsdfGrid moved;
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    if (made[i]) moved.Add(candidates[i], std::move(made[i]));
  }
  return moved;
}

}  // namespace tsdfpp
