// Method `tsdf++/literal`: the paper's sentences word for word (docs/map.md). Reported, never
// gated.
#pragma once

#include "mapper/index/active_field.h"
#include "mapper/index/pair_index.h"
#include "mapper/methods/object_volume_map.h"

namespace tsdfpp {

class LiteralMap final : public ObjectVolumeMap {
 public:
  explicit LiteralMap(const MapConfig& config) : ObjectVolumeMap(config), index_(config) {}

  Method method() const override { return Method::kTsdfppLiteral; }
  void SetObjectPose(InstanceId id, const Pose& T_WO) override;
  void Fuse(const Frame& frame, const cv::Mat& labels) override;
  void Remove(InstanceId id) override;
  Expected<void> Rename(InstanceId from, InstanceId to) override;
  Expected<void> Add(InstanceId id, const TsdfGrid& volume, const Pose& T_WL,
                     const std::optional<Pose>& T_WO) override;
  std::unique_ptr<MapRepresentation> Clone() const override;
  SurfacesInBlocks Surfaces() const override;
  std::vector<RaySurface> CastRays(const Intrinsics& camera, const Pose& T_WC,
                                   const RayCastOptions& options) const override;
  std::vector<Listing> ListAt(const Eigen::Vector3i& voxel) const override;
  std::vector<Eigen::Vector3i> ListedVoxels() const override;
  MapMemory Memory() const override;
  std::optional<std::string> FindFault() const override;
  void Save(Sections& sections) const override;
  Expected<void> Load(const Sections& sections) override;

 private:
  const TsdfGrid& Field() const { return field_.Of(index_, volumes_, config_); }

  PairIndex index_;
  ActiveField field_;
};

}  // namespace tsdfpp
