// The true surfaces of a scene, indexed once each in its own frame and placed by poses.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "core/types.h"
#include "metrics/solid.h"
#include "metrics/surface_index.h"

namespace tsdfpp {

// One object's true surface. Neither copied nor moved, for its parts refer to each other.
class TruthSurface {
 public:
  // `closed`: the model bounds a solid; else nothing is inside it.
  explicit TruthSurface(TrueModel model, bool closed = true);
  TruthSurface(const TruthSurface&) = delete;
  TruthSurface& operator=(const TruthSurface&) = delete;

  InstanceId id() const { return model_.info.id; }
  const TrueModel& model() const { return model_; }
  const SurfaceIndex& index_O() const { return index_O_; }
  const Solid& solid_O() const { return solid_O_; }
  const Eigen::AlignedBox3f& bounds_O() const { return bounds_O_; }

 private:
  TrueModel model_;
  SurfaceIndex index_O_;
  Solid solid_O_;
  Eigen::AlignedBox3f bounds_O_;
};

// A true surface at its current pose.
struct PlacedTruth {
  const TruthSurface* surface = nullptr;
  Pose T_WO = Pose::Identity();
};

// For each point (world frame) the distance to the nearest of the true surfaces, metres, its object
// and the triangle of that object's mesh; infinite, kNoInstance and NearestSurface::kNone where
// there is none. At equal distance the first in `truths`.
// With `within_m`, a limit a point, surfaces that are not nearer than it are passed over (and that
// limit is given back with kNoInstance): far cheaper where most points are far from everything.
struct NearestTruth {
  std::vector<float> distance_m;
  std::vector<InstanceId> object;
  std::vector<std::uint32_t> triangle;
};
NearestTruth FindNearestTruth(std::span<const Eigen::Vector3f> points_W,
                              std::span<const PlacedTruth> truths,
                              std::span<const float> within_m = {});

// 1 for each point (world frame) that lies inside one of the true solids.
std::vector<std::uint8_t> InsideTruth(std::span<const Eigen::Vector3f> points_W,
                                      std::span<const PlacedTruth> truths);

}  // namespace tsdfpp
