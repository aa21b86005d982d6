// Method `tsdf++/literal`: the paper's sentences word for word (docs/map.md). Reported, never
// gated.
#pragma once

#include "mapper/index/voxel_labels.h"
#include "mapper/methods/voxel_map.h"
#include "mapper/volume/volume_fusion.h"

namespace tsdfpp {

class LiteralMap final : public VoxelMap {
 public:
  explicit LiteralMap(const MapConfig& config) : config_(config) {}

  Method method() const override { return Method::kTsdfppLiteral; }
  const MapConfig& config() const override { return config_; }
  void SetObjectPose(InstanceId id, const Pose& T_WO) override;
  ObjectMove MoveTo(InstanceId id, const Pose& T_WO) const override;
  void Fuse(const Frame& frame, const cv::Mat& labels) override;
  void Remove(InstanceId id) override;
  Expected<void> Rename(InstanceId from, InstanceId to) override;
  Expected<void> Add(InstanceId id, const TsdfGrid& volume, const Pose& T_WL,
                     const Pose& T_WO) override;
  std::unique_ptr<MapRepresentation> Clone() const override;
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
  std::vector<Listing> ListAt(const Eigen::Vector3i& voxel) const override;
  std::vector<Eigen::Vector3i> ObservedVoxels(InstanceId id) const override;
  std::vector<Eigen::Vector3i> ListedVoxels() const override;
  MapMemory Memory() const override;
  std::optional<std::string> FindFault() const override;
  void Save(Sections& sections) const override;
  Expected<void> Load(const Sections& sections) override;

 private:
  struct Entry {
    InstanceId id = kNoInstance;
    std::int16_t confidence = 0;
  };
  struct ListBlock {
    std::array<Entry, kBlockVoxels> active{};
    std::array<Entry, kBlockVoxels> inactive{};
    std::uint64_t revision = 0;  // a new one whenever an active id changes
    bool IsEmpty() const;
  };
  // What the scene is meshed from: at each voxel the values of the object that is active there. A
  // copy starts empty.
  struct ActiveField {
    ActiveField() = default;
    ActiveField(const ActiveField&) {}
    // Blocks of lists or values that may have changed since it was made.
    bool all_are_stale = true;
    std::vector<Index3> stale;
    TsdfGrid field;
    BlockGrid<std::vector<std::uint64_t>> made_from;  // revisions of the lists and of each volume
    GridMesh mesh;
  };
  struct Task {
    Index3 index;
    ListBlock* lists = nullptr;
    PlannedBlock planned;
    std::vector<InstanceId> targets;  // objects that take an observation here, increasing
    bool changed = false;  // values; where another object is active now, it took an observation
  };

  void Vote(const FrameView& frame, const CameraFromLattice& T_CW, Task& task) const;
  void FuseActive(const FrameView& frame, const CameraFromLattice& T_CW, Task& task);
  // Gives the active object of the voxel nearest to a point (metres), the background where there is
  // none.
  VoxelLabels ActiveAtVoxels() const;
  void UpdateActiveField() const;
  void NoteFieldChange(const std::vector<Task>& tasks);
  // The list blocks in which the object was listed.
  std::vector<Index3> Unlist(InstanceId id);
  // Lists the object first wherever it is observed.
  void Activate(InstanceId id);
  // Frees those of these list blocks whose lists are all empty.
  void FreeEmptyLists(const std::vector<Index3>& blocks);

  MapConfig config_;
  ObjectVolumes volumes_;
  BlockGrid<ListBlock> lists_;
  mutable ActiveField active_;
  mutable std::map<InstanceId, GridMesh> object_meshes_;
};

}  // namespace tsdfpp
