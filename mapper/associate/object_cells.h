// Cells of space that move with an object.
#pragma once

#include <map>
#include <optional>

#include "core/types.h"
#include "mapper/volume/object_volume.h"

namespace tsdfpp {

class ObjectCells {
 public:
  // Objects are at T_WO, those that are not named at the identity; cells have the side `cell_m`.
  ObjectCells(const std::map<InstanceId, Pose>& T_WO, double cell_m) : cell_m_(cell_m) {
    for (const auto& [id, pose] : T_WO) T_OW_[id] = pose.inverse();
  }

  // The cell of an object's frame in which a point of the world is; nothing so far out that no map
  // has a voxel there.
  std::optional<Index3> CellOf(InstanceId object, const Eigen::Vector3d& p_W) const {
    const auto pose = T_OW_.find(object);
    const Eigen::Vector3d q = (pose == T_OW_.end() ? p_W : pose->second * p_W) / cell_m_;
    if (!(q.cwiseAbs().maxCoeff() < kFurthestCell)) return std::nullopt;
    return FloorOf(q);
  }

 private:
  static constexpr double kFurthestCell = double{kBlockSide} * (kFurthestBlock + 1);
  double cell_m_;
  std::map<InstanceId, Pose> T_OW_;
};

}  // namespace tsdfpp
