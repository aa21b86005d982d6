// Methods `tsdf` and `tsdf/min`: the paper's baseline, one field with a label a voxel (docs/map.md,
// "`tsdf`: one field").
#pragma once

#include "mapper/map_representation.h"
#include "mapper/tsdf_block.h"
#include "mapper/volume_fusion.h"

namespace tsdfpp {

// What a move does where the destination holds a surface already.
enum class MoveRule { kOverwrite, kKeepNearer };

class SingleFieldMap final : public MapRepresentation {
 public:
  SingleFieldMap(const MapConfig& config, MoveRule rule);

  void SetObjectPose(InstanceId id, const Pose& T_WO) override;
  void Fuse(const Frame& frame, const cv::Mat& labels) override;
  void Remove(InstanceId id) override;
  std::unique_ptr<MapRepresentation> Clone() const override;
  std::vector<InstanceId> Objects() const override;
  Pose ObjectLattice(InstanceId id) const override;
  TriangleMesh ObjectMesh(InstanceId id) const override;
  TriangleMesh SceneMesh() const override;
  std::optional<VoxelValue> ValueAt(InstanceId id, const Eigen::Vector3i& voxel) const override;
  std::vector<Listing> ListAt(const Eigen::Vector3i& voxel) const override;
  std::vector<Eigen::Vector3i> ObservedVoxels(InstanceId id) const override;
  std::vector<Eigen::Vector3i> ListedVoxels() const override;
  MapMemory Memory() const override;

 private:
  struct LabelBlock {
    LabelBlock() { id.fill(kNoInstance); }
    std::array<InstanceId, kBlockVoxels> id;
    std::array<std::uint16_t, kBlockVoxels> confidence{};
    std::uint64_t ever = 0;  // bit (id % 64) of every label that the block ever had
  };

  static std::uint64_t EverBit(InstanceId id) { return 1ULL << (id & 63U); }
  bool IsObjectsVoxel(const TsdfBlock& block, const LabelBlock& labels, std::size_t i,
                      InstanceId id) const {
    return labels.id[i] == id && block.weight[i] > 0 && block.distance[i] <= config_.voxel();
  }
  // `label` is the one that all the block's pixels have, kNoInstance where there may be several.
  // `next` as FuseVoxels() takes it.
  void FuseBlock(const FrameView& frame, const BlockPlace& place, InstanceId label,
                 const TsdfBlock* next, TsdfBlock& block, LabelBlock& labels) const;
  void Vacate(InstanceId id);
  template <typename Function>
  void ForEachVoxel(const Function& function) const;

  MapConfig config_;
  MoveRule rule_;
  TsdfGrid field_;
  BlockGrid<LabelBlock> labels_;  // the same blocks
  std::map<InstanceId, Pose> T_WO_;
};

}  // namespace tsdfpp
