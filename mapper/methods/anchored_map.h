// Method `tsdf++/anchored`: an object's volume stays in its own frame, the global index alone moves
// (docs/map.md, "The index of tsdf++/anchored").
#pragma once

#include "mapper/index/distance_index.h"
#include "mapper/methods/object_volume_map.h"

namespace tsdfpp {

class AnchoredMap final : public ObjectVolumeMap {
 public:
  AnchoredMap(const MapConfig& config, int layers)
      : ObjectVolumeMap(config), layers_(layers), index_(config, layers) {}

  Method method() const override { return Method::kTsdfppAnchored; }
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
  Expected<void> Load(const Sections& sections) override;

 protected:
  const DistanceIndex* Index() const override {
    index_.Refresh(volumes_);
    return &index_;
  }

 private:
  int layers_;
  DistanceIndex index_;
};

}  // namespace tsdfpp
