// Method `volumes`: one volume an object and no global index (docs/map.md, "`volumes`"): the family
// of MID-Fusion and EM-Fusion, to measure what the index is for.
#pragma once

#include "mapper/methods/object_volume_map.h"

namespace tsdfpp {

class VolumesMap final : public ObjectVolumeMap {
 public:
  explicit VolumesMap(const MapConfig& config) : ObjectVolumeMap(config) {}

  Method method() const override { return Method::kVolumes; }
  void SetObjectPose(InstanceId id, const Pose& T_WO) override;
  void Fuse(const Frame& frame, const cv::Mat& labels) override;
  void Remove(InstanceId id) override;
  std::unique_ptr<MapRepresentation> Clone() const override;
  // Asks every volume: the objects that cover the voxel, by distance, then id; kMaxLayers at most.
  std::vector<Listing> ListAt(const Eigen::Vector3i& voxel) const override;
  std::vector<Eigen::Vector3i> ListedVoxels() const override;
  std::optional<std::string> FindFault() const override;
};

}  // namespace tsdfpp
