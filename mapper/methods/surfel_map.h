// Method `surfels`: a list of discs an object in its own frame, and no voxels (docs/map.md,
// "`surfels`"): the family of ElasticFusion, Co-Fusion and MaskFusion, to show that the interface
// fits maps of another kind, and what they keep.
#pragma once

#include <optional>
#include <string>

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
  // A hexagon a stable disc, whose sides touch it: four triangles.
  TriangleMesh ObjectMesh(InstanceId id) const override;
  // The stable discs of all objects.
  TriangleMesh SceneMesh() const override;
  std::vector<RaySurface> CastRays(const Intrinsics& camera, const Pose& T_WC,
                                   const RayCastOptions& options) const override;
  // An object's list counts as one block.
  MapMemory Memory() const override;

  // The first thing found in what is stored that docs/map.md rules out, in a sentence.
  std::optional<std::string> FindFault() const;

  // What there is, stable or not, in the object's lattice frame; nullptr where there is nothing.
  const std::vector<Surfel>* SurfelsOf(InstanceId id) const;

 private:
  MapConfig config_;
  SurfelObjects objects_;
  std::uint32_t frames_ = 0;  // fused so far
};

}  // namespace tsdfpp
