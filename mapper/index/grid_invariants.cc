#include "mapper/index/grid_invariants.h"

#include <cmath>

#include "mapper/volume/object_volume.h"

namespace tsdfpp {
namespace {

// Of interpolated values, which may leave their range by that share.
constexpr float kRounding = 1e-5F;

std::size_t At(int i) { return static_cast<std::size_t>(i); }

struct Corner {
  bool observed = false;
  float distance = 0;
};

Corner CornerAt(const TsdfGrid& grid, const Index3& voxel) {
  const TsdfBlock* block = grid.Find(BlockOf(voxel));
  const std::size_t i = At(PlaceInBlock(voxel));
  if (block == nullptr || !(block->weight[i] > 0)) return {};
  return {true, block->distance[i]};
}

bool IsCrossed(const TsdfGrid& grid, const Index3& cube) {
  bool below = false;
  bool above = false;
  for (int i = 0; i < 8; ++i) {
    const Corner corner = CornerAt(grid, cube + Index3{i & 1, (i >> 1) & 1, i >> 2});
    if (!corner.observed) return false;
    (corner.distance < 0 ? below : above) = true;
  }
  return below && above;
}

Fault FindVoxelFault(const TsdfBlock& block, std::size_t i, const MapConfig& config) {
  const int weight = block.weight[i];
  const float distance = block.distance[i];
  const int colours = block.ColourCount(i);
  if (weight == 0) {
    const FixedColour none{};
    if (distance != 0 || colours != 0 || block.FixedColourAt(i) != none) {
      return fmt::format("is unobserved and holds distance {}, {} colours", distance, colours);
    }
    return std::nullopt;
  }
  const bool weighs = weight > 0 && weight <= config.weight_cap;
  if (!weighs || colours > config.weight_cap) {
    return fmt::format("has weight {} and {} colours, expected up to {}", weight, colours,
                       config.weight_cap);
  }
  const float slack = kRounding * config.front();
  if (!(distance >= -config.back() - slack && distance <= config.front() + slack)) {
    return fmt::format("has distance {}, expected {} to {}", distance, -config.back(),
                       config.front());
  }
  return std::nullopt;
}

}  // namespace

std::string BlockText(const Index3& v) { return fmt::format("({}, {}, {})", v.x, v.y, v.z); }

bool CoversPoint(const TsdfGrid& grid, const Eigen::Vector3d& q, float back) {
  const Index3 base{static_cast<int>(std::floor(q.x())), static_cast<int>(std::floor(q.y())),
                    static_cast<int>(std::floor(q.z()))};
  // Like the interpolation's, fractions are of single precision.
  const std::array<bool, 3> on_plane{static_cast<float>(q.x() - base.x) == 0,
                                     static_cast<float>(q.y() - base.y) == 0,
                                     static_cast<float>(q.z() - base.z) == 0};
  for (int i = 0; i < 8; ++i) {
    const Index3 below{i & 1, (i >> 1) & 1, i >> 2};
    if ((below.x != 0 && !on_plane[0]) || (below.y != 0 && !on_plane[1]) ||
        (below.z != 0 && !on_plane[2])) {
      continue;
    }
    if (IsCrossed(grid, {base.x - below.x, base.y - below.y, base.z - below.z})) return true;
  }
  const auto distance = DistanceAtPoint(grid, q);
  return distance && *distance < 0 && *distance >= -back;
}

std::optional<float> DistanceAtPoint(const TsdfGrid& grid, const Eigen::Vector3d& q) {
  const Index3 base{static_cast<int>(std::floor(q.x())), static_cast<int>(std::floor(q.y())),
                    static_cast<int>(std::floor(q.z()))};
  const std::array<float, 3> f{static_cast<float>(q.x() - base.x),
                               static_cast<float>(q.y() - base.y),
                               static_cast<float>(q.z() - base.z)};
  std::array<float, 8> distance{};
  for (int i = 0; i < 8; ++i) {
    bool counts = true;
    for (int axis = 0; axis < 3; ++axis) {
      counts = counts && (((i >> axis) & 1) != 0 ? f[At(axis)] != 0 : f[At(axis)] != 1);
    }
    if (!counts) continue;
    const Corner corner = CornerAt(grid, base + Index3{i & 1, (i >> 1) & 1, i >> 2});
    if (!corner.observed) return std::nullopt;
    distance[At(i)] = corner.distance;
  }
  return Trilinear(distance, f);
}

namespace {

Fault FindCubeFault(const std::string& name, const TsdfGrid& grid) {
  for (const auto& [index, block] : grid.entries()) {
    for (int place = 0; place < kBlockVoxels; ++place) {
      const Index3 voxel = VoxelAt(index, place);
      if (Bit(block->crossed, place) == IsCrossed(grid, voxel)) continue;
      return fmt::format("{}: whether the cube of voxel {} is crossed is wrong", name,
                         BlockText(voxel));
    }
  }
  return std::nullopt;
}

}  // namespace

Fault FindGridFault(const std::string& name, const TsdfGrid& grid, const MapConfig& config,
                    bool with_cover) {
  if (Fault fault = FindHashFault(name, grid)) return fault;
  for (const auto& [index, block] : grid.entries()) {
    bool any = false;
    for (int place = 0; place < kBlockVoxels; ++place) {
      const std::size_t i = At(place);
      const float distance = block->distance[i];
      const bool observed = block->weight[i] > 0;
      const Index3 voxel = VoxelAt(index, place);
      any = any || observed;
      if (const Fault fault = FindVoxelFault(*block, i, config)) {
        return fmt::format("{}: voxel {} {}", name, BlockText(voxel), *fault);
      }
      const bool negative = observed && distance < 0;
      const bool right = Bit(block->observed, place) == observed &&
                         Bit(block->negative, place) == negative &&
                         Bit(block->band, place) == (negative && distance >= -config.back()) &&
                         (!Bit(block->full, place) || block->weight[i] == config.weight_cap);
      if (!right) return fmt::format("{}: the masks of voxel {} are wrong", name, BlockText(voxel));
      const Eigen::Vector3d q(voxel.x, voxel.y, voxel.z);
      if (with_cover && Bit(block->cover, place) != CoversPoint(grid, q, config.back())) {
        return fmt::format("{}: the cover of voxel {} is wrong", name, BlockText(voxel));
      }
    }
    if (!any) return fmt::format("{}: block {} is empty", name, BlockText(index));
    for (std::size_t z = 0; z < block->colours.size(); ++z) {
      if (block->colours[z] == nullptr) continue;
      const auto& count = block->colours[z]->count;
      if (std::all_of(count.begin(), count.end(), [](auto n) { return n == 0; })) {
        return fmt::format("{}: block {} keeps slice {} of colours with no voxel with a colour",
                           name, BlockText(index), z);
      }
    }
  }
  return with_cover ? FindCubeFault(name, grid) : std::nullopt;
}

}  // namespace tsdfpp
