// What tsdf++ and tsdf++/anchored share: object volumes, their meshes, the visible scene.
#pragma once

#include "mapper/mesh/scene_parts.h"
#include "mapper/methods/voxel_map.h"
#include "mapper/volume/volume_fusion.h"

namespace tsdfpp {

class LayeredMap : public VoxelMap {
 public:
  const MapConfig& config() const override { return config_; }
  // Of volumes that stay in their objects' lattices.
  ObjectMove MoveTo(InstanceId id, const Pose& T_WO) const override;
  std::map<InstanceId, Pose> MovedLattices() const override;
  std::vector<InstanceId> Objects() const override;
  Pose ObjectLattice(InstanceId id) const override;
  TriangleMesh ObjectMesh(InstanceId id) const override;
  TriangleMesh SceneMesh() const override;
  SceneChanges TakeSceneChanges() const override;
  std::vector<RaySurface> CastRays(const Intrinsics& camera, const Pose& T_WC,
                                   const RayCastOptions& options) const override;
  MeshWork UpdateMeshes() const override;
  std::optional<VoxelValue> ValueAt(InstanceId id, const Eigen::Vector3i& voxel) const override;
  const TsdfGrid* GridOf(InstanceId id) const override;
  std::vector<Eigen::Vector3i> ObservedVoxels(InstanceId id) const override;
  // What follows is of the volumes alone: all there is to do for a map without an index, and the
  // first part of it for one with an index. Volumes stay in their objects' lattices.
  Expected<void> Rename(InstanceId from, InstanceId to) override;
  Expected<void> Add(InstanceId id, const TsdfGrid& volume, const Pose& T_WL,
                     const Pose& T_WO) override;
  std::optional<std::string> FindFault() const override;
  void Save(Sections& sections) const override;
  // Covers are not up to date.
  Expected<void> Load(const Sections& sections) override;

 protected:
  explicit LayeredMap(const MapConfig& config) : config_(config) {}
  LayeredMap(const LayeredMap&) = default;

  // The active objects of the kBlockVoxels voxels of a block of the global index, kNoInstance where
  // there is none; nullptr where nothing is listed in the block.
  virtual const InstanceId* ActiveIn(const Index3& block) const = 0;
  // Whether anybody is active anywhere, so that triangles may be hidden.
  virtual bool HasIndex() const { return true; }
  // The active object of a global voxel, or kNoInstance.
  InstanceId ActiveAt(const Index3& voxel) const {
    const InstanceId* ids = ActiveIn(BlockOf(voxel));
    return ids == nullptr ? kNoInstance : ids[PlaceInBlock(voxel)];
  }

  // Tells the visible scene that other objects may be active in this block of the index than were.
  // Not needed where that is because the one that was is gone or has moved: the scene sees to what
  // its blocks hid.
  void NoteIndexChange(const Index3& block) const;
  // False while it need not be told.
  bool NotesIndexChanges() const { return !anything_may_be_hidden_; }

  MapMemory VolumeMemory() const;
  // FindFault() of the volumes; adds their blocks to `blocks`. Covers are those of volumes whose
  // lattice is the world's.
  std::optional<std::string> FindVolumeFault(bool with_covers, std::size_t& blocks) const;

  MapConfig config_;
  ObjectVolumes volumes_;

 private:
  MeshWork UpdateObjectMesh(InstanceId id) const;
  // Where triangles may have become hidden or visible since the last update, in global blocks.
  struct VisibilityChanges {
    BlockSet index;                 // other objects may be active
    BlockSet values;                // distances of some objects are others ...
    std::uint64_t whose = 0;        // ... of those with these bits
    InstanceId only = kNoInstance;  // if it is one alone, that one
    std::vector<BlockBox> all;
    BlockSet near;  // these and the blocks beside them
  };
  // Nothing where that may be anywhere.
  std::optional<VisibilityChanges> WhereVisibilityChanged() const;
  // The parts of the object whose triangles are to be looked up again; all where `where` is
  // nothing.
  std::vector<MeshPart*> PartsToLookUp(InstanceId id, PlacedMesh& object,
                                       const std::optional<VisibilityChanges>& where) const;
  void FindHiddenTriangles(const std::optional<VisibilityChanges>& where) const;

  // Shown parts of objects that are gone. A copy starts empty, as its meshes do.
  struct GoneParts {
    GoneParts() = default;
    GoneParts(const GoneParts&) {}
    std::vector<ScenePiece> parts;
  };

  mutable std::map<InstanceId, PlacedMesh> meshes_;
  mutable GoneParts gone_;
  mutable std::vector<Index3> index_changes_;  // since the last update
  mutable bool anything_may_be_hidden_ = true;
};

// The observed voxels of a grid, sorted by (z, y, x).
std::vector<Eigen::Vector3i> ObservedVoxelsOf(const TsdfGrid& grid);
// The voxel's value, nothing where it is unobserved.
std::optional<VoxelValue> ValueOf(const TsdfGrid& grid, const Index3& voxel);
// Sorts by (z, y, x).
std::vector<Eigen::Vector3i> SortedVoxels(std::vector<Index3> voxels);

}  // namespace tsdfpp
