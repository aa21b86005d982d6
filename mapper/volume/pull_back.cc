#include "mapper/volume/pull_back.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>

namespace tsdfpp {
namespace {

constexpr std::size_t kBlocksPerTask = 8;
std::size_t At(int i) { return static_cast<std::size_t>(i); }

PatchBlocks BlocksOf(const VoxelReader& reader, const PulledPoints& points) {
  PatchBlocks blocks{};
  const Index3 first = BlockOf(points.low);
  const Index3 last = BlockOf(points.high);
  for (int z = 0; z <= last.z - first.z; ++z) {
    for (int y = 0; y <= last.y - first.y; ++y) {
      for (int x = 0; x <= last.x - first.x; ++x) {
        blocks[At(9 * z + 3 * y + x)] = reader.BlockAt(first + Index3{x, y, z});
      }
    }
  }
  return blocks;
}

template <typename Predicate>
bool AnyOf(const PatchBlocks& blocks, const Predicate& predicate) {
  return std::any_of(blocks.begin(), blocks.end(),
                     [&](const TsdfBlock* block) { return block != nullptr && predicate(*block); });
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
  const PatchBlocks blocks = BlocksOf(reader, points);
  if (!AnyOf(blocks, [](const TsdfBlock& block) { return block.AnyNegative(); })) return false;
  PatchRows observed;
  PatchRows negative;
  PatchBits(blocks, points, &TsdfBlock::observed, observed);
  PatchBits(blocks, points, &TsdfBlock::negative, negative);
  PatchCubes cubes;
  PatchCubesOf(observed, negative, cubes);
  // Both conditions of a cover need a negative corner, in the point's own cube unless the point
  // lies on a plane: then one of the cubes around it, and its own cube's lower corners are among
  // theirs.
  const BlockMask in_crossed = InMarkedCube(cubes.crossed, points);
  BlockMask candidates = MarkedAt(cubes.any_negative, points);
  for (std::size_t z = 0; z < candidates.size(); ++z) candidates[z] |= in_crossed[z];
  if (!Any(candidates)) return false;
  PatchValues values;
  PatchValuesOf(blocks, points, PatchField::kDistance, values);
  InterpolateCounted(values, points, candidates, out.distance.data());
  out.covered = Covered(candidates, in_crossed, out.distance.data(), back);
  return Any(out.covered);
}

bool ResampleBlock(const VoxelReader& reader, const std::array<double, 12>& T_inverse,
                   double voxel_m, const Index3& index, TsdfBlock& out, Resampling resampling) {
  PulledPoints points = PointsOf(T_inverse, voxel_m, index);
  const PatchBlocks blocks = BlocksOf(reader, points);
  if (!AnyOf(blocks, [](const TsdfBlock&) { return true; })) return false;
  PatchRows observed;
  PatchBits(blocks, points, &TsdfBlock::observed, observed);
  const bool all_count = resampling == Resampling::kAll;
  const bool nearest = resampling == Resampling::kNearest;
  // At the nearest corner itself, the only one that then counts.
  if (nearest) RoundFractions(points);
  const auto interpolate = all_count ? InterpolateAll
                           : nearest ? InterpolateCounted
                                     : InterpolateObserved;
  BlockMask wanted;
  if (all_count) {
    PatchCubes cubes;
    PatchCubesOf(observed, PatchRows{}, cubes);
    wanted = MarkedAt(cubes.all_observed, points);
  } else {
    wanted = MarkedNearest(observed, points);
  }
  if (!Any(wanted)) return false;
  PatchValues values;
  const auto at_points = [&](PatchField field, PatchValues& patch, float* interpolated) {
    PatchValuesOf(blocks, points, field, patch);
    interpolate(patch, points, wanted, interpolated);
  };
  std::array<float, kBlockVoxels> distance;
  at_points(PatchField::kDistance, values, distance.data());
  std::array<float, kBlockVoxels> weight;
  at_points(PatchField::kWeight, values, weight.data());
  PutValues(wanted, distance.data(), weight.data(), out);
  if (!AnyOf(blocks, [](const TsdfBlock& block) { return block.HasColours(); })) return true;
  PatchValues counts;
  std::array<float, kBlockVoxels> count;
  at_points(PatchField::kColourCount, counts, count.data());
  std::array<PatchValues, 3> channels;
  PatchValuesOf(blocks, points, PatchField::kRed, channels[0]);
  PatchValuesOf(blocks, points, PatchField::kGreen, channels[1]);
  PatchValuesOf(blocks, points, PatchField::kBlue, channels[2]);
  PutColours(channels, counts, points, wanted, count.data(), out);
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
