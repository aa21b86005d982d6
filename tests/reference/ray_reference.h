// Rays as docs/map.md, "Ray casting", states them, in tiny steps of the trilinear distance in each
// object's lattice: nothing is skipped, nothing is bounded.
#pragma once

#include <map>
#include <optional>
#include <vector>

#include "mapper/map_representation.h"
#include "tests/reference/dense_grid.h"
#include "tests/reference/dense_voxel.h"

namespace tsdfpp::reference {

struct RayHit {
  double depth = 0;  // metres along the optical axis
  InstanceId id = kNoInstance;
  Eigen::Vector3d normal_W = Eigen::Vector3d::Zero();
};

class RayReference {
 public:
  // Copies what the map says of the voxels of `box`, in which all has to lie.
  RayReference(const MapRepresentation& map, Method method, const MapConfig& config, const Box& box,
               const std::vector<InstanceId>& ids);

  // The first visible surface on the ray from the camera through a pixel, at most `far_m` away
  // along the optical axis, in the map without the objects `without` (for methods of object
  // volumes).
  std::optional<RayHit> Cast(const Intrinsics& camera, const Pose& T_WC, int u, int v, double far_m,
                             const std::vector<InstanceId>& without = {}) const;

  // Whether the eight corners around a surface point of the object are known. One field: the map
  // does not tell of observed voxels without a label.
  bool Knows(InstanceId id, const Eigen::Vector3d& p_W) const;

 private:
  struct Field {
    DenseGrid<DenseVoxel> grid;
    Pose T_LW;
  };
  bool Hidden(InstanceId id, const RayHit& hit, const Eigen::Vector3d& p_W,
              const std::vector<InstanceId>& without) const;

  const MapRepresentation& map_;
  MapConfig config_;
  bool one_field_;
  bool has_index_;
  std::map<InstanceId, Field> fields_;
};

}  // namespace tsdfpp::reference
