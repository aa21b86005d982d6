// One voxel of the references in floating point: what an observation weighs and what it does.
//
// docs/map.md gives every observation the weight 1, which a byte holds. voxblox, on which the
// authors' TSDF++ stands, weighs by depth and by the distance behind the surface; these are its
// rules (voxblox, BSD-3: TsdfIntegratorBase::getVoxelWeight and updateTsdfVoxel in
// voxblox/src/integrator/tsdf_integrator.cc; the same in Integrator of ethz-asl/tsdf-plusplus,
// tsdf_plusplus/src/integrator/integrator.cc), written anew from their formulas.
#pragma once

#include <array>
#include <optional>

#include "tests/reference/dense_voxel.h"

namespace tsdfpp::reference {

struct Weighting {
  bool inverse_square = false;  // 1 / z^2 of the surface (metres), else 1
  bool drop_off = false;        // linearly to 0 at -B, from one voxel behind the surface on
  // Times the pixels that a voxel covers, fx fy (h / z)^2 of the voxel: voxblox bundles the rays
  // that end in one voxel and gives the bundle the sum of their weights.
  bool rays = false;
  float cap = 50;
};

struct FloatConfig {
  double voxel_m = 0.01;
  double front_voxels = 10;
  double back_voxels = 10;
  Weighting weighting;
  // voxblox averages what lies in front of the band as it is and clamps the mean; docs/map.md
  // clamps the observation.
  bool clamp_mean = false;
  // As production stores them: distances in half precision; weights whole, at most 255.
  bool half_distances = false;
  bool byte_weights = false;

  // The same for what only takes a MapConfig; all that is not said here has its default.
  MapConfig Map() const;
};

struct FloatVoxel {
  float distance = 0;  // metres
  float weight = 0;    // observed where above 0

  bool observed() const { return weight > 0; }
};

// A FloatConfig with its lengths as they are compared.
class FloatRule {
 public:
  explicit FloatRule(const FloatConfig& config);

  const FloatConfig& config() const { return config_; }
  const MapConfig& map() const { return map_; }
  float voxel() const { return voxel_; }
  float front() const { return front_; }
  float back() const { return back_; }

  bool InBand(float s) const { return -back_ <= s && s <= front_; }

  // What an observation weighs, whose pixel has these focal lengths.
  float WeightOf(const Seen& seen, const Intrinsics& camera) const;

  // One observation of that weight, in band or clamped; nothing behind the band.
  void Fuse(const Seen& seen, float weight, FloatVoxel& voxel) const;

  // Sets a voxel to one observation of that weight (docs/map.md, "Fusion": contradiction).
  FloatVoxel Fresh(float distance, float weight) const;

  // docs/map.md, "Resampling" with `all`: nothing unless the eight corners are observed.
  std::optional<FloatVoxel> Interpolate(const Neighbourhood& place,
                                        const std::array<FloatVoxel, 8>& corners) const;

 private:
  FloatVoxel Stored(float distance, float weight) const;

  FloatConfig config_;
  MapConfig map_;
  float voxel_;
  float front_;
  float back_;
};

}  // namespace tsdfpp::reference
