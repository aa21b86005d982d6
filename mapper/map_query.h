// What a planner asks of a map: how far is it from here to a surface, whose, in which direction,
// and how sure is the map.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "mapper/map_representation.h"

namespace tsdfpp {

class VoxelInspection;

// One surface as seen from a point, interpolated trilinearly between the eight voxel centres around
// the point in the object's own lattice.
struct SurfaceDistance {
  InstanceId id = kNoInstance;
  // Metres to the surface, above 0 on its free side; truncated to [-back, front], so `front` means
  // "that far or further".
  float distance_m = 0;
  // Of the distance, in the world's frame, without unit: away from the surface, of a length of
  // about 1 near it and of 0 where the distance is truncated.
  Eigen::Vector3f gradient_W = Eigen::Vector3f::Zero();
  float weight = 0;  // observations
};

struct PointAnswer {
  // The visible scene: the surface of the object that is active at the voxel nearest to the point;
  // in free space, which is nobody's, the nearest surface of all. Nothing where no object's eight
  // voxels are observed: unknown, which is neither free nor occupied.
  std::optional<SurfaceDistance> visible;
  // Every object whose eight voxels around the point are observed, hidden ones included, by
  // increasing distance, ties by id. One field knows one surface, with the label of the nearest
  // voxel (the background's where it has none).
  std::vector<SurfaceDistance> objects;
};

// Answers from a map that must outlive it and not change meanwhile. Making it costs a walk over the
// map's blocks; a question costs some eight reads an object.
class MapQuery {
 public:
  // Errors: kUsage, a sentence, where the map has no voxels.
  static Expected<MapQuery> Of(const MapRepresentation& map);

  // `p_W` in the world's frame, metres. A point that is not finite, or too far away for the
  // lattice, is unknown.
  PointAnswer At(const Eigen::Vector3d& p_W) const;
  // The same for many points, in parallel, in their order.
  std::vector<PointAnswer> At(const std::vector<Eigen::Vector3d>& points_W) const;

 private:
  MapQuery(const MapRepresentation& map, const VoxelInspection& voxels);

  struct Object;

  std::optional<SurfaceDistance> Ask(const Object& object, const Eigen::Vector3d& p_W) const;

  const VoxelInspection* voxels_;
  double voxel_m_;
  bool one_field_;
  std::shared_ptr<const std::vector<Object>> objects_;  // copies ask the same
};

}  // namespace tsdfpp
