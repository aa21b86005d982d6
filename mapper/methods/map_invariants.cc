#include "mapper/methods/map_invariants.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>

namespace tsdfpp {
namespace {

// Beyond, the check takes longer than what it checks by far.
[[maybe_unused]] constexpr std::size_t kMostBlocksInDebugBuilds = 1000;

Index3 IndexOf(const Eigen::Vector3i& v) { return {v.x(), v.y(), v.z()}; }

}  // namespace

void CheckInDebugBuilds([[maybe_unused]] const VoxelMap& map) {
#ifndef NDEBUG
  if (map.Memory().blocks > kMostBlocksInDebugBuilds) return;
  if (const Fault fault = map.FindFault()) {
    std::fprintf(stderr, "tsdfpp: %s\n", fault->c_str());
    std::abort();
  }
#endif
}

Fault FindListFault(const VoxelMap& map) {
  const std::vector<InstanceId> objects = map.Objects();
  const MapConfig& config = map.config();
  const int layers = LayersOf(map.method(), config);
  const int confidence_cap = std::max(config.confidence_cap, config.moved_confidence);
  // Then labels of one field stay on the free space of objects that left.
  const bool labels_stay =
      IsOneField(map.method()) && config.moved_voxels == MovedVoxels::kNearSurface;
  for (const Eigen::Vector3i& v : map.ListedVoxels()) {
    const std::vector<Listing> list = map.ListAt(v);
    const std::string at = BlockText(IndexOf(v));
    if (list.empty()) return fmt::format("voxel {} is listed with no object", at);
    if (static_cast<int>(list.size()) > layers) {
      return fmt::format("voxel {} lists {} objects, expected up to {}", at, list.size(), layers);
    }
    for (std::size_t i = 0; i < list.size(); ++i) {
      for (std::size_t k = 0; k < i; ++k) {
        if (list[k].id == list[i].id) {
          return fmt::format("voxel {} lists object {} twice", at, list[i].id);
        }
      }
      if (list[i].confidence < 0 || list[i].confidence > confidence_cap) {
        return fmt::format("voxel {} has confidence {}, expected 0 to {}", at, list[i].confidence,
                           confidence_cap);
      }
      if (!labels_stay && !std::binary_search(objects.begin(), objects.end(), list[i].id)) {
        return fmt::format("voxel {} lists object {}, which is not in the map", at, list[i].id);
      }
    }
  }
  return std::nullopt;
}

Fault FindCountFault(const VoxelMap& map, std::size_t blocks) {
  const std::size_t counted = map.Memory().blocks;
  if (counted == blocks) return std::nullopt;
  return fmt::format("the map counts {} blocks and has {}", counted, blocks);
}

Fault FindCoverFault(const VoxelMap& map, bool by_distance) {
  const MapConfig& config = map.config();
  for (const Eigen::Vector3i& v : map.ListedVoxels()) {
    std::optional<std::pair<float, InstanceId>> last;
    for (const Listing& listing : map.ListAt(v)) {
      const Pose T_WL = map.ObjectLattice(listing.id);
      const Eigen::Vector3d voxel = v.cast<double>();
      const Eigen::Vector3d q =
          SameNumbers(T_WL, Pose::Identity())
              ? voxel
              : Eigen::Vector3d((T_WL.inverse() * (voxel * config.voxel_m)) / config.voxel_m);
      const TsdfGrid& grid = *map.GridOf(listing.id);
      if (!CoversPoint(grid, q, config.back())) {
        return fmt::format("object {} is listed at voxel {} and does not cover it", listing.id,
                           BlockText(IndexOf(v)));
      }
      const std::pair<float, InstanceId> now{DistanceAtPoint(grid, q).value(), listing.id};
      if (by_distance && last && now < *last) {
        return fmt::format("object {} is listed at voxel {} behind object {}, which is less near",
                           listing.id, BlockText(IndexOf(v)), last->second);
      }
      last = now;
    }
  }
  return std::nullopt;
}

}  // namespace tsdfpp
