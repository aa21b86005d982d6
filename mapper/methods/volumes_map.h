// Method `volumes`: one volume an object and no global index (docs/map.md, "`volumes`"): the family
// of MID-Fusion and EM-Fusion, to measure what the index is for.
#pragma once

#include "mapper/methods/layered_map.h"

namespace tsdfpp {

class VolumesMap final : public LayeredMap {
 public:
  explicit VolumesMap(const MapConfig& config) : LayeredMap(config) {}

  Method method() const override { return Method::kVolumes; }
  void SetObjectPose(InstanceId id, const Pose& T_WO) override;
  void Fuse(const Frame& frame, const cv::Mat& labels) override;
  void Remove(InstanceId id) override;
  std::unique_ptr<MapRepresentation> Clone() const override;
  // Asks every volume: the objects that cover the voxel, by distance, then id; kMaxLayers at most.
  std::vector<Listing> ListAt(const Eigen::Vector3i& voxel) const override;
  std::vector<Eigen::Vector3i> ListedVoxels() const override;
  MapMemory Memory() const override;
  Expected<void> Load(const Sections& sections) override;
  std::vector<RaySurface> CastRays(const Intrinsics& camera, const Pose& T_WC,
                                   const RayCastOptions& options) const override;

 protected:
  // Nobody: without an index nothing hides what another object claims.
  const InstanceId* ActiveIn(const Index3&) const override { return nullptr; }
  bool HasIndex() const override { return false; }
};

}  // namespace tsdfpp
