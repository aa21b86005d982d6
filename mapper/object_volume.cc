#include "mapper/object_volume.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <cmath>
#include <limits>

namespace tsdfpp {
namespace {

constexpr std::size_t kLargestTable = 1U << 22U;  // block pointers, 32 MiB

std::size_t At(int i) { return static_cast<std::size_t>(i); }

}  // namespace

VoxelReader::VoxelReader(const TsdfGrid& grid) : grid_(&grid) {
  if (grid.empty()) return;
  constexpr int kMax = std::numeric_limits<int>::max();
  constexpr int kMin = std::numeric_limits<int>::min();
  Index3 low{kMax, kMax, kMax};
  Index3 high{kMin, kMin, kMin};
  for (const auto& entry : grid.entries()) {
    low = {std::min(low.x, entry.index.x), std::min(low.y, entry.index.y),
           std::min(low.z, entry.index.z)};
    high = {std::max(high.x, entry.index.x), std::max(high.y, entry.index.y),
            std::max(high.z, entry.index.z)};
  }
  low_ = low;
  size_ = {high.x - low.x + 1, high.y - low.y + 1, high.z - low.z + 1};
  const double volume = double{1} * size_.x * size_.y * size_.z;
  if (volume > static_cast<double>(kLargestTable)) return;
  blocks_.resize(static_cast<std::size_t>(volume), nullptr);
  for (const auto& entry : grid.entries()) {
    const std::size_t x = At(entry.index.x - low_.x);
    const std::size_t y = At(entry.index.y - low_.y);
    const std::size_t z = At(entry.index.z - low_.z);
    blocks_[(z * At(size_.y) + y) * At(size_.x) + x] = entry.block.get();
  }
}

Corners FindCorners(const VoxelReader& reader, const Eigen::Vector3d& q) {
  Corners corners;
  corners.base = FloorOf(q);
  corners.fraction = {static_cast<float>(q.x() - corners.base.x),
                      static_cast<float>(q.y() - corners.base.y),
                      static_cast<float>(q.z() - corners.base.z)};
  const Index3& base = corners.base;
  const TsdfBlock* inner = nullptr;
  const bool one_block = (base.x & 7) != 7 && (base.y & 7) != 7 && (base.z & 7) != 7;
  if (one_block) {
    inner = reader.BlockAt(BlockOf(base));
    if (inner == nullptr) return corners;
  }
  for (int i = 0; i < 8; ++i) {
    const Index3 voxel = base + Index3{i & 1, (i >> 1) & 1, i >> 2};
    corners.block[At(i)] = one_block ? inner : reader.BlockAt(BlockOf(voxel));
    corners.place[At(i)] = PlaceInBlock(voxel);
  }
  return corners;
}

float Trilinear(const std::array<float, 8>& corner, const std::array<float, 3>& fraction) {
  const auto [fx, fy, fz] = fraction;
  const float c00 = corner[0] * (1 - fx) + corner[1] * fx;  // y, z
  const float c10 = corner[2] * (1 - fx) + corner[3] * fx;
  const float c01 = corner[4] * (1 - fx) + corner[5] * fx;
  const float c11 = corner[6] * (1 - fx) + corner[7] * fx;
  const float c0 = c00 * (1 - fy) + c10 * fy;
  const float c1 = c01 * (1 - fy) + c11 * fy;
  return c0 * (1 - fz) + c1 * fz;
}

std::optional<float> DistanceAt(const Corners& corners) {
  std::array<float, 8> distance{};
  for (int i = 0; i < 8; ++i) {
    bool counts = true;
    for (int axis = 0; axis < 3; ++axis) {
      const float f = corners.fraction[At(axis)];
      counts = counts && (((i >> axis) & 1) != 0 ? f != 0 : f != 1);
    }
    if (!counts) continue;
    const TsdfBlock* block = corners.block[At(i)];
    if (block == nullptr || block->weight[At(corners.place[At(i)])] <= 0) return std::nullopt;
    distance[At(i)] = block->distance[At(corners.place[At(i)])];
  }
  return Trilinear(distance, corners.fraction);
}

bool Covers(const VoxelReader& reader, const Corners& corners, float back,
            std::optional<float>& distance) {
  distance = DistanceAt(corners);
  if (!distance) return false;
  if (*distance < 0 && *distance >= -back) return true;
  // The closed cubes that hold the point: one, or more where it lies on a lattice plane.
  const Index3& base = corners.base;
  const auto lowest = [&](int axis) { return corners.fraction[At(axis)] == 0 ? -1 : 0; };
  for (int dz = lowest(2); dz <= 0; ++dz) {
    for (int dy = lowest(1); dy <= 0; ++dy) {
      for (int dx = lowest(0); dx <= 0; ++dx) {
        const bool own = dx == 0 && dy == 0 && dz == 0;
        const Corners cube =
            own ? corners
                : FindCorners(reader, Eigen::Vector3d(base.x + dx, base.y + dy, base.z + dz));
        bool all = true;
        bool negative = false;
        bool positive = false;
        for (int i = 0; i < 8 && all; ++i) {
          const TsdfBlock* block = cube.block[At(i)];
          all = block != nullptr && block->weight[At(cube.place[At(i)])] > 0;
          if (all) {
            (block->distance[At(cube.place[At(i)])] < 0 ? negative : positive) = true;
          }
        }
        if (all && negative && positive) return true;
      }
    }
  }
  return false;
}

std::optional<Resampled> ResampleAt(const Corners& corners) {
  std::array<float, 8> distance{};
  std::array<float, 8> weight{};
  std::array<float, 8> count{};
  for (int i = 0; i < 8; ++i) {
    const TsdfBlock* block = corners.block[At(i)];
    const std::size_t place = At(corners.place[At(i)]);
    if (block == nullptr || block->weight[place] <= 0) return std::nullopt;
    distance[At(i)] = block->distance[place];
    weight[At(i)] = block->weight[place];
    count[At(i)] = block->colour_count[place];
  }
  Resampled voxel;
  voxel.distance = Trilinear(distance, corners.fraction);
  voxel.weight = Trilinear(weight, corners.fraction);
  voxel.colour_count = static_cast<std::uint16_t>(Trilinear(count, corners.fraction) + 0.5F);
  float total = 0;
  std::array<float, 3> colour{};
  for (int i = 0; i < 8; ++i) {
    if (count[At(i)] <= 0) continue;
    float coefficient = 1;
    for (int axis = 0; axis < 3; ++axis) {
      const float f = corners.fraction[At(axis)];
      coefficient *= ((i >> axis) & 1) != 0 ? f : 1 - f;
    }
    total += coefficient;
    const auto& c = corners.block[At(i)]->colour[At(corners.place[At(i)])];
    for (std::size_t channel = 0; channel < 3; ++channel)
      colour[channel] += coefficient * c[channel];
  }
  if (total > 0) {
    for (std::size_t channel = 0; channel < 3; ++channel) {
      voxel.colour[channel] = static_cast<std::uint16_t>(colour[channel] / total + 0.5F);
    }
  } else {
    voxel.colour_count = 0;
  }
  return voxel;
}

std::vector<Index3> BlocksTouchedBy(const VoxelReader& reader, const Pose& T, double voxel_m) {
  std::vector<Index3> blocks;
  if (reader.empty()) return blocks;
  Eigen::AlignedBox3d box;
  const Index3 low = reader.low();
  const Index3 high = reader.high();
  for (int i = 0; i < 8; ++i) {
    const Eigen::Vector3d corner(
        (i & 1) != 0 ? high.x * kBlockSide + kBlockSide : low.x * kBlockSide - 1,
        (i & 2) != 0 ? high.y * kBlockSide + kBlockSide : low.y * kBlockSide - 1,
        (i & 4) != 0 ? high.z * kBlockSide + kBlockSide : low.z * kBlockSide - 1);
    box.extend(T * (corner * voxel_m) / voxel_m);
  }
  const auto block_of = [](double voxel) { return static_cast<int>(std::floor(voxel)) >> 3; };
  const Pose T_inverse = T.inverse();
  // A box around the transformed block, in the lattice of the source.
  const auto touches = [&](const Index3& block) {
    Eigen::AlignedBox3d source;
    for (int i = 0; i < 8; ++i) {
      const Eigen::Vector3d corner(block.x * kBlockSide + ((i & 1) != 0 ? 7 : 0),
                                   block.y * kBlockSide + ((i & 2) != 0 ? 7 : 0),
                                   block.z * kBlockSide + ((i & 4) != 0 ? 7 : 0));
      source.extend(T_inverse * (corner * voxel_m) / voxel_m);
    }
    for (int z = block_of(source.min().z() - 1); z <= block_of(source.max().z() + 1); ++z) {
      for (int y = block_of(source.min().y() - 1); y <= block_of(source.max().y() + 1); ++y) {
        for (int x = block_of(source.min().x() - 1); x <= block_of(source.max().x() + 1); ++x) {
          if (reader.BlockAt({x, y, z}) != nullptr) return true;
        }
      }
    }
    return false;
  };
  for (int z = block_of(box.min().z() - 1); z <= block_of(box.max().z() + 1); ++z) {
    for (int y = block_of(box.min().y() - 1); y <= block_of(box.max().y() + 1); ++y) {
      for (int x = block_of(box.min().x() - 1); x <= block_of(box.max().x() + 1); ++x) {
        if (touches({x, y, z})) blocks.push_back({x, y, z});
      }
    }
  }
  return blocks;
}

TsdfGrid ResampleGrid(const TsdfGrid& grid, const Pose& T_rel, double voxel_m, float back) {
  const VoxelReader reader(grid);
  const std::vector<Index3> candidates = BlocksTouchedBy(reader, T_rel, voxel_m);
  std::vector<std::unique_ptr<TsdfBlock>> made(candidates.size());
  const Pose T_inverse = T_rel.inverse();
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, candidates.size(), 8),
      [&](const tbb::blocked_range<std::size_t>& range) {
        for (std::size_t i = range.begin(); i != range.end(); ++i) {
          auto block = std::make_unique<TsdfBlock>();
          bool any = false;
          for (int place = 0; place < kBlockVoxels; ++place) {
            const Index3 v = VoxelAt(candidates[i], place);
            const Eigen::Vector3d q =
                T_inverse * (Eigen::Vector3d(v.x, v.y, v.z) * voxel_m) / voxel_m;
            const auto voxel = ResampleAt(FindCorners(reader, q));
            if (!voxel) continue;
            any = true;
            block->distance[At(place)] = voxel->distance;
            block->weight[At(place)] = voxel->weight;
            block->colour[At(place)] = voxel->colour;
            block->colour_count[At(place)] = voxel->colour_count;
          }
          if (!any) continue;
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
