// Methods `tsdf`, `tsdf/min`, `tsdf/guarded` and `tsdf/static`: one field with a label a voxel, the
// paper's baseline and its variants (docs/map.md, "`tsdf`: one field").
#pragma once

#include "mapper/methods/labelled_field.h"
#include "mapper/methods/voxel_map.h"

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
                     const std::optional<Pose>& T_WO) override;
  std::unique_ptr<MapRepresentation> Clone() const override;
  std::vector<InstanceId> Objects() const override;
  Pose ObjectLattice(InstanceId id) const override;
  SurfacesInBlocks Surfaces() const override;
  std::vector<RaySurface> CastRays(const Intrinsics& camera, const Pose& T_WC,
                                   const RayCastOptions& options) const override;
  std::optional<VoxelValue> ValueAt(InstanceId id, const Eigen::Vector3i& voxel) const override;
  const TsdfGrid* GridOf(InstanceId id) const override;
  std::vector<Listing> ListAt(const Eigen::Vector3i& voxel) const override;
  std::vector<Eigen::Vector3i> ObservedVoxels(InstanceId id) const override;
  std::vector<Eigen::Vector3i> ListedVoxels() const override;
  MapMemory Memory() const override;
  std::optional<std::string> FindFault() const override;
  void Save(Sections& sections) const override;
  Expected<void> Load(const Sections& sections) override;
  std::optional<Pose> LastPose(InstanceId id) const override;

 private:
  using LabelBlock = LabelledField::LabelBlock;

  // Labels a voxel, or was given a pose.
  bool IsKnown(InstanceId id) const { return T_WO_.contains(id) || field_.Holds(id); }

  MapConfig config_;
  FieldRule rule_;
  LabelledField field_;
  std::map<InstanceId, Pose> T_WO_;
};

}  // namespace tsdfpp
