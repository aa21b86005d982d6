// What tsdf++ and tsdf++/anchored share: object volumes, their meshes, the visible scene.
#pragma once

#include "mapper/map_representation.h"
#include "mapper/volume_fusion.h"

namespace tsdfpp {

class LayeredMap : public MapRepresentation {
 public:
  std::vector<InstanceId> Objects() const override;
  Pose ObjectLattice(InstanceId id) const override;
  TriangleMesh ObjectMesh(InstanceId id) const override;
  TriangleMesh SceneMesh() const override;
  std::optional<VoxelValue> ValueAt(InstanceId id, const Eigen::Vector3i& voxel) const override;
  std::vector<Eigen::Vector3i> ObservedVoxels(InstanceId id) const override;

 protected:
  explicit LayeredMap(const MapConfig& config) : config_(config) {}
  LayeredMap(const LayeredMap&) = default;

  // The active object of a global voxel, or kNoInstance.
  virtual InstanceId ActiveAt(const Index3& voxel) const = 0;

  // A block whose cover may have changed with a frame.
  struct StaleCover {
    InstanceId id = kNoInstance;
    Index3 index;
    TsdfBlock* block = nullptr;
    const TsdfGrid* grid = nullptr;
  };
  // Of the volumes in the world's lattice, by id, each block once.
  std::vector<StaleCover> StaleCovers(const std::vector<FusedBlock>& fused) const;
  // The covers as they are now, one for each of these; their blocks still hold the old ones.
  static std::vector<BlockMask> NewCovers(const std::vector<StaleCover>& stale);

  MapMemory VolumeMemory() const;

  MapConfig config_;
  ObjectVolumes volumes_;
};

// The observed voxels of a grid, sorted by (z, y, x).
std::vector<Eigen::Vector3i> ObservedVoxelsOf(const TsdfGrid& grid);
// The voxel's value, nothing where it is unobserved.
std::optional<VoxelValue> ValueOf(const TsdfGrid& grid, const Index3& voxel);
// Sorts by (z, y, x).
std::vector<Eigen::Vector3i> SortedVoxels(std::vector<Index3> voxels);

}  // namespace tsdfpp
