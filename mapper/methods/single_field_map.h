// Methods `tsdf`, `tsdf/min`, `tsdf/guarded` and `tsdf/static`: one field with a label a voxel, the
// paper's baseline and its variants (docs/map.md, "`tsdf`: one field").
#pragma once

#include <functional>

#include "mapper/index/voxel_labels.h"
#include "mapper/mesh/mesh_cache.h"
#include "mapper/methods/voxel_map.h"
#include "mapper/volume/tsdf_block.h"
#include "mapper/volume/volume_fusion.h"

namespace tsdfpp {

// How the variants differ.
enum class FieldRule {
  kOverwrite,   // moved values replace what is at their destination
  kKeepNearer,  // they do where their magnitude is the smaller one
  kGuarded,     // as kOverwrite; labels guard their surfaces from what is fused behind others, and
                // rims are completed
  kStatic,      // poses move nothing
};

class SingleFieldMap final : public VoxelMap {
 public:
  SingleFieldMap(const MapConfig& config, FieldRule rule);

  Method method() const override;
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
  struct LabelBlock {
    LabelBlock() { id.fill(kNoInstance); }
    std::array<InstanceId, kBlockVoxels> id;
    std::array<std::uint16_t, kBlockVoxels> confidence{};
    std::uint64_t ever = 0;  // bit (id % 64) of every label that the block ever had
  };

  static std::uint64_t EverBit(InstanceId id) { return 1ULL << (id & 63U); }
  // Whether a voxel that has this distance goes with the object that it is labelled with.
  bool Moves(float distance) const {
    return config_.moved_voxels == MovedVoxels::kAll || distance <= config_.voxel();
  }
  bool IsObjectsVoxel(const TsdfBlock& block, const LabelBlock& labels, std::size_t i,
                      InstanceId id) const {
    return labels.id[i] == id && block.weight[i] > 0 && Moves(block.distance[i]);
  }
  // `label` is the one that all the block's pixels have, kNoInstance where there may be several.
  // `next` as FuseVoxels() takes it.
  void FuseBlock(const FrameView& frame, const BlockPlace& place, InstanceId label,
                 const TsdfBlock* next, TsdfBlock& block, LabelBlock& labels) const;
  // Rims of one field (docs/map.md, `tsdf/guarded`).
  void CompleteRims(const FrameView& frame);
  // Gives the label of the voxel nearest to a point (metres), the background's where it has none.
  VoxelLabels LabelOfVoxels() const;
  // Makes the object's voxels unlabelled, and unobserved or free; returns their blocks.
  std::vector<Index3> Vacate(InstanceId id, RemovedVoxels become);
  // Writes the values of a block that moved here, as `rule_` allows; confidence(i) is what voxel i
  // brings along.
  void Arrive(InstanceId id, const Index3& index, const TsdfBlock& arrival,
              const std::function<std::uint16_t(std::size_t)>& confidence);
  // Labels a voxel, or was given a pose.
  bool IsKnown(InstanceId id) const;
  // Frees those of these blocks that have no observed voxel.
  void FreeEmpty(const std::vector<Index3>& blocks);
  template <typename Function>
  void ForEachVoxel(const Function& function) const;

  MapConfig config_;
  FieldRule rule_;
  TsdfGrid field_;
  BlockGrid<LabelBlock> labels_;  // the same blocks
  std::map<InstanceId, Pose> T_WO_;
  mutable GridMesh mesh_;
};

}  // namespace tsdfpp
