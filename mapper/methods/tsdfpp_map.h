// Method `tsdf++`: the paper's map as a careful engineer would build it (docs/map.md): volumes in
// the world's lattice under an index that votes.
#pragma once

#include "mapper/index/voting_index.h"
#include "mapper/methods/object_volume_map.h"

namespace tsdfpp {

class TsdfppMap final : public ObjectVolumeMap {
 public:
  TsdfppMap(const MapConfig& config, int layers)
      : ObjectVolumeMap(config), layers_(layers), index_(config, layers) {}

  Method method() const override { return Method::kTsdfpp; }
  void SetObjectPose(InstanceId id, const Pose& T_WO) override;
  void Fuse(const Frame& frame, const cv::Mat& labels) override;
  void Remove(InstanceId id) override;
  Expected<void> Rename(InstanceId from, InstanceId to) override;
  Expected<void> Add(InstanceId id, const TsdfGrid& volume, const Pose& T_WL,
                     const std::optional<Pose>& T_WO) override;
  std::unique_ptr<MapRepresentation> Clone() const override;
  std::vector<Eigen::Vector3i> ListedVoxels() const override;
  MapMemory Memory() const override;
  std::vector<RaySurface> CastRays(const Intrinsics& camera, const Pose& T_WC,
                                   const RayCastOptions& options) const override;
  std::optional<std::string> FindFault() const override;
  void Save(Sections& sections) const override;
  Expected<void> Load(const Sections& sections) override;

 protected:
  const GlobalIndex* Index() const override { return &index_; }

 private:
  int layers_;
  VotingIndex index_;
};

}  // namespace tsdfpp
