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
  std::vector<RaySurface> CastRays(const Intrinsics& camera, const Pose& T_WC,
                                   const RayCastOptions& options) const override;
  std::optional<VoxelValue> ValueAt(InstanceId id, const Eigen::Vector3i& voxel) const override;
  std::vector<Eigen::Vector3i> ObservedVoxels(InstanceId id) const override;

 protected:
  explicit LayeredMap(const MapConfig& config) : config_(config) {}
  LayeredMap(const LayeredMap&) = default;

  // The active objects of a block of the global index, kNoInstance where there is none: that of the
  // i-th voxel is first[i * stride]. `first` is nullptr where nothing is listed.
  struct ActiveIds {
    const InstanceId* first = nullptr;
    std::size_t stride = 0;

    // Where the voxel's is, nullptr where nothing is listed.
    const InstanceId* Place(int place) const {
      return first == nullptr ? nullptr : first + static_cast<std::size_t>(place) * stride;
    }
  };
  virtual ActiveIds ActiveIn(const Index3& block) const = 0;
  // The active object of a global voxel, or kNoInstance.
  InstanceId ActiveAt(const Index3& voxel) const {
    const InstanceId* place = ActiveIn(BlockOf(voxel)).Place(PlaceInBlock(voxel));
    return place == nullptr ? kNoInstance : *place;
  }

  // Blocks of the world-lattice volume that hold or touch a fused block: those whose cover may
  // change. Sorted, unique.
  static std::vector<Index3> WithNeighbours(const TsdfGrid& grid, std::vector<Index3> blocks);

  // The fused blocks of one object whose masks changed.
  static std::vector<Index3> ChangedMasks(const std::vector<FusedBlock>& fused, InstanceId id);

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
