// How far points are from the surfaces of a map's objects: all that association asks of a map.
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "core/types.h"
#include "mapper/map_representation.h"
#include "mapper/volume/object_volume.h"
#include "mapper/voxel_inspection.h"

namespace tsdfpp {

// Reads the objects' volumes rather than the lists of the global map volume: the same objects, and
// those that a list had no place for, at a cost that does not grow with the background. A single
// field says how far its surface is, and by the label of the nearest voxel whose it is. Made for
// one frame; the map must not change meanwhile.
class ObjectLookup {
 public:
  enum class Of { kObjects, kObjectsAndBackground };
  explicit ObjectLookup(const MapRepresentation& map, Of of = Of::kObjects);

  // The map's objects that have a volume (none of a map without voxels), by id, the background only
  // where it was asked for.
  const std::vector<InstanceId>& ids() const { return ids_; }

  // The place of an object in ids().
  std::optional<std::size_t> NumberOf(InstanceId id) const;

  // Which of ids() may have a surface where one of the points is, all of the world's frame.
  std::vector<std::size_t> Around(const std::vector<Eigen::Vector3d>& points_W) const;

  struct Distance {
    std::size_t object = 0;  // of ids()
    float voxels = 0;        // without sign
    float weight = 0;        // observations behind it
  };

  // The distances of a point to the surfaces of those objects (some of ids(), increasing) that say
  // something there but that it is free, each at its last pose. They and the weights are
  // interpolated between those of the eight voxels around the point that are observed, which must
  // make up half of the coefficients.
  void Distances(const Eigen::Vector3d& p_W, std::span<const std::size_t> objects,
                 std::vector<Distance>& distances) const;

  // The box around an object's surface voxels, along the axes of its lattice (of the world, of one
  // field, whose voxels are of the object that their label says), but for a share of kStray of them
  // on each side: masks that bleed leave some far from all others. Empty where it has none.
  struct SurfaceBox {
    Pose T_LW = Pose::Identity();
    Eigen::AlignedBox3d box_L;  // metres
  };
  static constexpr double kStray = 0.03;
  // Of each of those objects (some of ids(), increasing), at the cost of their voxels, or of the
  // one field's.
  std::vector<SurfaceBox> BoxesOfSurfaces(std::span<const std::size_t> objects) const;

  // Whether the volume of an object (one of ids(); all of one field) has a surface in the block of
  // the point, which is of the world's frame, or in one beside it.
  bool HasSurfaceAround(std::size_t object, const Eigen::Vector3d& p_W) const;

 private:
  struct Place {
    VoxelReader reader;
    Pose T_LW;
    Eigen::AlignedBox3d box_W;  // around all points that it can say something about
  };

  // The voxels of an object's grid that are on its surface.
  void VisitSurface(InstanceId of, const std::function<void(const Index3& voxel)>& visit) const;

  const VoxelInspection* voxels_;
  double voxel_m_;
  float front_m_;  // the truncation distance
  std::vector<InstanceId> ids_;
  std::vector<Place> places_;  // of ids_, or of the one field
  bool one_field_;
};

}  // namespace tsdfpp
