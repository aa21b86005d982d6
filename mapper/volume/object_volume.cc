#include "mapper/volume/object_volume.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>

#include "mapper/volume/block_set.h"

namespace tsdfpp {
namespace {

constexpr std::size_t kLargestTable = 1U << 22U;  // block pointers, 32 MiB

// Blocks of a box that are asked one by one, for each block that is moved: as many as may be near
// it. There are more only where an object was seen at places far from each other, between which
// there is nothing.
constexpr double kMostInBox = 7 * 7 * 7;

std::size_t At(int i) { return static_cast<std::size_t>(i); }

// Those blocks of a box that `touches` holds of, which it does only near a moved block: each is
// asked for what is near it.
std::vector<Index3> TouchedFarApart(const VoxelReader& reader, const Pose& T, double voxel_m,
                                    const BlockBox& box,
                                    const std::function<bool(const Index3&)>& touches) {
  // A block touches another whose middle is at most half its own side away along each axis, the
  // half diagonal of the turned block, and two voxels: 11.6 voxels, in any direction times sqrt(3).
  constexpr double kReach_voxels = 21;
  constexpr double kMiddle = (kBlockSide - 1) / 2.0;
  constexpr std::size_t kBlocksAtOnce = 4096;
  const auto clean = [](std::vector<Index3>& blocks) {
    std::sort(blocks.begin(), blocks.end());
    blocks.erase(std::unique(blocks.begin(), blocks.end()), blocks.end());
  };
  std::vector<Index3> touched;
  std::vector<Index3> near;
  const auto& entries = reader.grid().entries();
  for (std::size_t from = 0; from < entries.size(); from += kBlocksAtOnce) {
    near.clear();
    const std::size_t end = std::min(entries.size(), from + kBlocksAtOnce);
    for (std::size_t i = from; i < end; ++i) {
      const Index3& index = entries[i].index;
      const Eigen::Vector3d middle =
          double{kBlockSide} * Eigen::Vector3d(index.x, index.y, index.z) +
          Eigen::Vector3d::Constant(kMiddle);
      const Eigen::Vector3d moved = T * (middle * voxel_m) / voxel_m;
      const Index3 low = BlockOf(FloorOf(moved - Eigen::Vector3d::Constant(kReach_voxels)));
      const Index3 high = BlockOf(FloorOf(moved + Eigen::Vector3d::Constant(kReach_voxels)));
      for (int z = low.z; z <= high.z; ++z) {
        for (int y = low.y; y <= high.y; ++y) {
          for (int x = low.x; x <= high.x; ++x) {
            if (box.Holds({x, y, z})) near.push_back({x, y, z});
          }
        }
      }
    }
    clean(near);
    std::copy_if(near.begin(), near.end(), std::back_inserter(touched), touches);
  }
  clean(touched);
  return touched;
}

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
  const Index3 base = FloorOf(q);
  Corners corners = FindCorners(reader, base);
  corners.fraction = {static_cast<float>(q.x() - base.x), static_cast<float>(q.y() - base.y),
                      static_cast<float>(q.z() - base.z)};
  return corners;
}

Corners FindCorners(const VoxelReader& reader, const Index3& base) {
  Corners corners;
  corners.base = base;
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

std::vector<Index3> BlocksTouchedBy(const VoxelReader& reader, const Pose& T, double voxel_m,
                                    bool only_negative) {
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
          const TsdfBlock* block_L = reader.BlockAt({x, y, z});
          if (block_L != nullptr && (!only_negative || block_L->AnyNegative())) return true;
        }
      }
    }
    return false;
  };
  BlockBox candidates;
  candidates.Extend(
      {block_of(box.min().x() - 1), block_of(box.min().y() - 1), block_of(box.min().z() - 1)});
  candidates.Extend(
      {block_of(box.max().x() + 1), block_of(box.max().y() + 1), block_of(box.max().z() + 1)});
  const auto& [first, last, is_empty] = candidates;
  const auto side = [](int from, int to) { return double{1} + to - from; };
  if (side(first.x, last.x) * side(first.y, last.y) * side(first.z, last.z) >
      kMostInBox * static_cast<double>(reader.grid().size())) {
    return TouchedFarApart(reader, T, voxel_m, candidates, touches);
  }
  for (int z = first.z; z <= last.z; ++z) {
    for (int y = first.y; y <= last.y; ++y) {
      for (int x = first.x; x <= last.x; ++x) {
        if (touches({x, y, z})) blocks.push_back({x, y, z});
      }
    }
  }
  return blocks;
}

}  // namespace tsdfpp
