// What the maps of object volumes share: the volumes, and all that is said of these alone. How
// poses and frames change them, and the index over them, are the method's.
#pragma once

#include "mapper/index/global_index.h"
#include "mapper/methods/voxel_map.h"
#include "mapper/volume/volume_fusion.h"

namespace tsdfpp {

class ObjectVolumeMap : public VoxelMap {
 public:
  const MapConfig& config() const override { return config_; }
  ObjectMove MoveTo(InstanceId id, const Pose& T_WO) const override;
  std::map<InstanceId, Pose> MovedLattices() const override;
  std::vector<InstanceId> Objects() const override;
  Pose ObjectLattice(InstanceId id) const override;
  SurfacesInBlocks Surfaces() const override;
  std::vector<RaySurface> CastRays(const Intrinsics& camera, const Pose& T_WC,
                                   const RayCastOptions& options) const override;
  std::optional<VoxelValue> ValueAt(InstanceId id, const Eigen::Vector3i& voxel) const override;
  const TsdfGrid* GridOf(InstanceId id) const override;
  std::vector<Eigen::Vector3i> ObservedVoxels(InstanceId id) const override;
  std::vector<Listing> ListAt(const Eigen::Vector3i& voxel) const override;
  // What follows is of the volumes alone: all there is to do for a map without an index, and the
  // first part of it for one with an index.
  Expected<void> Rename(InstanceId from, InstanceId to) override;
  Expected<void> Add(InstanceId id, const TsdfGrid& volume, const Pose& T_WL,
                     const std::optional<Pose>& T_WO) override;
  MapMemory Memory() const override;
  void Save(Sections& sections) const override;
  // Covers are not up to date.
  Expected<void> Load(const Sections& sections) override;
  std::optional<Pose> LastPose(InstanceId id) const override;

 protected:
  explicit ObjectVolumeMap(const MapConfig& config) : config_(config) {}
  ObjectVolumeMap(const ObjectVolumeMap&) = default;

  // The index that says who hides whom, up to date; nullptr where there is none.
  virtual const GlobalIndex* Index() const { return nullptr; }

  // FindFault() of the volumes; adds their blocks to `blocks`. Covers are those of volumes whose
  // lattice is the world's.
  std::optional<std::string> FindVolumeFault(bool with_covers, std::size_t& blocks) const;

  // Whether a pose moves values through the world's lattice, or the object's own lattice.
  bool MovesValues() const { return InfoOf(method()).moves_values; }
  // Gives an object another pose and moves its values by what changed; false where that is nothing.
  // `before` is called in between, when the old values are still there.
  bool MoveValues(InstanceId id, const Pose& T_WO, const std::function<void()>& before);
  // Gives an object another pose and moves its lattice; false where that changes nothing. `before`
  // as above.
  bool MoveLattice(InstanceId id, const Pose& T_WO, const std::function<void()>& before);

  MapConfig config_;
  ObjectVolumes volumes_;
};

}  // namespace tsdfpp
