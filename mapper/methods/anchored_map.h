// Method `tsdf++/anchored`: an object's volume stays in its own frame, the global index alone moves
// (docs/map.md, "The index of tsdf++/anchored").
#pragma once

#include "mapper/methods/layered_map.h"

namespace tsdfpp {

class AnchoredMap final : public LayeredMap {
 public:
  AnchoredMap(const MapConfig& config, int layers);

  Method method() const override { return Method::kTsdfppAnchored; }
  void SetObjectPose(InstanceId id, const Pose& T_WO) override;
  void Fuse(const Frame& frame, const cv::Mat& labels) override;
  void Remove(InstanceId id) override;
  Expected<void> Rename(InstanceId from, InstanceId to) override;
  Expected<void> Add(InstanceId id, const TsdfGrid& volume, const Pose& T_WL,
                     const Pose& T_WO) override;
  std::unique_ptr<MapRepresentation> Clone() const override;
  std::vector<Listing> ListAt(const Eigen::Vector3i& voxel) const override;
  std::vector<Eigen::Vector3i> ListedVoxels() const override;
  MapMemory Memory() const override;
  std::vector<RaySurface> CastRays(const Intrinsics& camera, const Pose& T_WC,
                                   const RayCastOptions& options) const override;
  MeshWork UpdateMeshes() const override;
  std::optional<std::string> FindFault() const override;
  Expected<void> Load(const Sections& sections) override;

 protected:
  const InstanceId* ActiveIn(const Index3& block) const override;

 private:
  // Entry k of the list of voxel i at [k * kBlockVoxels + i], active first, kNoInstance where
  // unused; as many layers as the block has objects, up to K.
  using IndexBlock = std::vector<InstanceId>;
  struct Participants;
  struct Scratch;

  // Recomputes the index where `dirty_` says that its inputs changed. Logically const: the index is
  // a function of volumes and poses.
  void RefreshIndex() const;
  void AddReach(InstanceId id) const;
  void ComputeBlock(const Index3& index, const Participants& participants, Scratch& scratch,
                    IndexBlock& ids) const;

  int layers_;
  mutable BlockGrid<IndexBlock> index_;
  mutable std::map<InstanceId, std::vector<Index3>>
      reach_;  // global blocks that a moved object can list
  mutable std::vector<Index3> dirty_;
  mutable std::vector<InstanceId> moved_;  // objects whose whole reach is dirty
};

}  // namespace tsdfpp
