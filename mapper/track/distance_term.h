// The term of a tracker that compares a segment's points with an object's signed distances
// (docs/tracking.md; after Bylow et al., RSS 2013).
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "mapper/track/pose_least_squares.h"
#include "mapper/track/sdf_track_config.h"
#include "mapper/track/segment_points.h"
#include "mapper/track/surface_reader.h"

namespace tsdfpp {

// What the points say at a pose.
struct DistanceCounts {
  int points = 0;
  int observed = 0;  // with eight observed voxels around them
  int inliers = 0;   // of these, nearer to the surface than inlier_voxels
  // 1.4826 times the median of the absolute distances to the surface, metres; 0 where there are
  // none.
  double deviation_m = 0;
};

class DistanceTerm {
 public:
  // All are read while the term lives. `stride` > 1 takes every stride-th point alone.
  DistanceTerm(const SurfaceReader& model, std::span<const SegmentPoint> points,
               const MotionFrame& frame, double voxel_m, const Intrinsics& camera,
               const SdfTrackConfig& config, std::size_t stride = 1);

  // Beyond this a residual counts linearly, metres.
  void SetHuber(double huber_m) {
    huber_m_ = huber_m;
    last_.reset();
  }

  // Keeps from now on what belongs to the points y = T p: their weights, the lengths of the
  // gradients by which their distances are divided, and, where they are `curved`, their sags. These
  // jump from one cube of voxels to the next, and a search goes astray over a cost that jumps.
  // Points without a distance here have none in Sums() until this is called again.
  void KeepAt(const Pose& T_LC);

  // The terms' sums over the points y = T p, with weights of at most 1 and so in units of a point:
  // of the least deviation that the config's noise knows. A point without a distance costs as much
  // as one at the Huber width: a side that the model lacks is no reason to be elsewhere. One that
  // had a distance where it was kept costs as much as it did there. KeepAt() must have been called.
  // In parallel, in fixed chunks.
  NormalEquations Sums(const Pose& T_LC) const;

  // In parallel.
  DistanceCounts Count(const Pose& T_LC) const;

  // The deviation of DistanceCounts where the points were kept.
  double KeptDeviation_m() const;

 private:
  std::size_t Taken() const { return (points_.size() + stride_ - 1) / stride_; }
  // What belongs to a point at one pose.
  struct Kept {
    float sag_m = 0;
    float per_slope = 0;  // 1 / the gradient's length; 0 where there is no distance
    float weight = 0;
    float distance_m = 0;
  };
  // Of the k-th that is taken.
  SurfaceSample SampleAt(const Pose& T_LC, std::size_t k) const {
    const Eigen::Vector3d y = T_LC * points_[k * stride_].p_C.cast<double>();
    return kept_.empty() ? model_->At(y) : model_->At(y, kept_[k].sag_m, cubes_[k]);
  }
  // Whether the distance there lies between two surfaces (SdfTrackConfig::max_slope); `ray_L` is
  // the camera's, of any length.
  bool IsOfTwoSurfaces(const SurfaceSample& at, const Eigen::Vector3d& ray_L) const;
  double WeightOf(const SurfaceSample& at, const Eigen::Vector3d& p_C, const Eigen::Vector3d& y,
                  const Eigen::Vector3d& camera_L) const;
  void AddChunk(const Pose& T_LC, std::size_t begin, std::size_t end, NormalEquations& sums) const;

  const SurfaceReader* model_;
  std::span<const SegmentPoint> points_;
  MotionFrame frame_;
  SdfTrackConfig config_;
  double voxel_m_;
  double lateral_per_m_;  // the deviation across the axis, by depth
  std::size_t stride_;
  double huber_m_;
  std::vector<Kept> kept_;  // a point each that is taken, or empty
  // The last pose that was asked for: a search begins where it was asked what is known.
  struct SumsAt {
    Pose T_LC;
    NormalEquations sums;
  };
  mutable std::optional<SumsAt> last_;
  // The same, once points were kept. A point is looked at by one thread at a time.
  mutable std::vector<VoxelCube> cubes_;
};

}  // namespace tsdfpp
