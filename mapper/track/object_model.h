// What a tracker takes from a map: an object's signed distances and where they are.
#pragma once

#include <optional>

#include "mapper/map_representation.h"
#include "mapper/voxel_inspection.h"

namespace tsdfpp {

struct ObjectModel {
  const TsdfGrid* grid = nullptr;  // valid until the map changes
  Pose T_WL = Pose::Identity();
};

// Nothing where the map has no such object, or nothing of it. The one place where a tracker looks
// into a map. Of one field this is the whole field, whose distances are the object's near it.
inline std::optional<ObjectModel> ModelOf(const MapRepresentation& map, InstanceId id) {
  const VoxelInspection* voxels = map.inspection();
  const TsdfGrid* grid = voxels == nullptr ? nullptr : voxels->GridOf(id);
  if (grid == nullptr || grid->empty()) return std::nullopt;
  return ObjectModel{grid, map.ObjectLattice(id)};
}

}  // namespace tsdfpp
