#include "mapper/methods/voxel_answers.h"

#include <algorithm>
#include <utility>

namespace tsdfpp {

std::vector<Eigen::Vector3i> SortedVoxels(std::vector<Index3> voxels) {
  std::sort(voxels.begin(), voxels.end());
  std::vector<Eigen::Vector3i> sorted;
  sorted.reserve(voxels.size());
  for (const Index3& v : voxels) sorted.emplace_back(v.x, v.y, v.z);
  return sorted;
}

std::vector<Eigen::Vector3i> ObservedVoxelsOf(const TsdfGrid& grid) {
  std::vector<Index3> voxels;
  for (const auto& entry : grid.entries()) {
    for (int place = 0; place < kBlockVoxels; ++place) {
      if (Bit(entry.block->observed, place)) voxels.push_back(VoxelAt(entry.index, place));
    }
  }
  return SortedVoxels(std::move(voxels));
}

bool CanBeStored(const Index3& voxel) {
  const auto is_near = [](int i) { return i >= -kFurthestStored && i <= kFurthestStored; };
  const Index3 block = BlockOf(voxel);
  return is_near(block.x) && is_near(block.y) && is_near(block.z);
}

std::optional<VoxelValue> ValueOf(const TsdfGrid& grid, const Index3& voxel) {
  if (!CanBeStored(voxel)) return std::nullopt;
  const TsdfBlock* block = grid.Find(BlockOf(voxel));
  const int place = PlaceInBlock(voxel);
  const auto i = static_cast<std::size_t>(place);
  if (block == nullptr || block->weight[i] <= 0) return std::nullopt;
  return VoxelValue{block->distance[i], static_cast<float>(block->weight[i]),
                    block->ColourAt(place)};
}

}  // namespace tsdfpp
