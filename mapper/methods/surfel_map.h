// Method `surfels`: a list of discs an object in its own frame, and no voxels (docs/map.md,
// "`surfels`"): the family of ElasticFusion, Co-Fusion and MaskFusion, to show that the interface
// fits maps of another kind, and what they keep.
#pragma once

#include "mapper/map_representation.h"
#include "mapper/methods/surfel_list.h"

namespace tsdfpp {

class SurfelMap final : public MapRepresentation {
 public:
  explicit SurfelMap(const MapConfig& config) : config_(config) {}

  Method method() const override { return Method::kSurfels; }
  const MapConfig& config() const override { return config_; }
  void SetObjectPose(InstanceId id, const Pose& T_WO) override;
  void Fuse(const Frame& frame, const cv::Mat& labels) override;
  void Remove(InstanceId id) override { objects_.erase(id); }
  std::unique_ptr<MapRepresentation> Clone() const override;
  std::vector<InstanceId> Objects() const override;
  Pose ObjectLattice(InstanceId id) const override;
  std::map<InstanceId, Pose> MovedLattices() const override;
  ObjectMove MoveTo(InstanceId id, const Pose& T_WO) const override;
  // A hexagon a stable disc, whose sides touch it: four triangles.
  TriangleMesh ObjectMesh(InstanceId id) const override;
  // The stable discs of all objects.
  TriangleMesh SceneMesh() const override;
  std::vector<RaySurface> CastRays(const Intrinsics& camera, const Pose& T_WC,
                                   const RayCastOptions& options) const override;
  // An object's list counts as one block.
  MapMemory Memory() const override;
  std::optional<std::string> FindFault() const override;

  Expected<void> Rename(InstanceId, InstanceId) override { return NoVoxels("renames nothing"); }
  Expected<void> Add(InstanceId, const TsdfGrid&, const Pose&, const Pose&) override {
    return NoVoxels("takes no volumes");
  }
  SceneChanges TakeSceneChanges() const override { return {}; }
  std::optional<VoxelValue> ValueAt(InstanceId, const Eigen::Vector3i&) const override {
    return {};
  }
  const TsdfGrid* GridOf(InstanceId) const override { return nullptr; }
  std::vector<Listing> ListAt(const Eigen::Vector3i&) const override { return {}; }
  std::vector<Eigen::Vector3i> ObservedVoxels(InstanceId) const override { return {}; }
  std::vector<Eigen::Vector3i> ListedVoxels() const override { return {}; }
  void Save(Sections&) const override {}
  Expected<void> Load(const Sections&) override { return NoVoxels("has no saved form"); }
  static Expected<void> NoVoxels(std::string_view what) {
    return UsageError("method 'surfels' keeps no voxels and {}", what);
  }

  // What there is, stable or not, in the object's lattice frame; nullptr where there is nothing.
  const std::vector<Surfel>* SurfelsOf(InstanceId id) const;

 private:
  MapConfig config_;
  SurfelObjects objects_;
  std::uint32_t frames_ = 0;  // fused so far
};

}  // namespace tsdfpp
