// Terms of a tracker that ask a frame's image about points of an object (docs/tracking.md, "Terms
// of the image").
#pragma once

#include <cstddef>
#include <utility>
#include <vector>

#include "mapper/track/pose_least_squares.h"

namespace tsdfpp {

// What a frame says of a point of an object.
struct PointSight {
  bool is_seen = false;
  double r = 0;                                       // in the term's own unit
  Eigen::Vector3d slope_C = Eigen::Vector3d::Zero();  // of r over the point's place, a metre
};

class PointTerm {
 public:
  // The points are the lattice's, metres. `weight` is that of an error of one deviation, in points
  // of the distances.
  PointTerm(std::vector<Eigen::Vector3d> points_L, double weight)
      : points_L_(std::move(points_L)), weight_(weight) {}
  virtual ~PointTerm() = default;
  PointTerm(const PointTerm&) = delete;
  PointTerm& operator=(const PointTerm&) = delete;

  // Keeps from now on which points are seen, and the deviation of their errors (1.4826 times the
  // median of their sizes, or the least that is possible). Their errors count in these, times
  // `distance_m`: the deviation of the distances. T_LC takes the camera's frame to the lattice.
  void KeepAt(const Pose& T_LC, double distance_m);

  // The sums of the points that are kept, square metres; robust, after Huber. One that is seen no
  // more costs as much as where it was kept. KeepAt() must have been called.
  NormalEquations Sums(const Pose& T_LC, const MotionFrame& frame) const;

  // What the points tell of motions at T_LC once they are where they belong, so that their errors
  // have the deviation that such errors have at best: the Hessian of Sums() with that.
  Matrix6 Information(const Pose& T_LC, const MotionFrame& frame) const;

 protected:
  // Called where points are kept, before the first of them is looked at for that.
  virtual void Prepare(const Pose& /*T_LC*/) {}
  // Whether a point may be kept, beside being seen.
  virtual bool IsFit(std::size_t /*point*/, const Eigen::Vector3d& /*p_C*/) const { return true; }
  virtual PointSight At(std::size_t point, const Eigen::Vector3d& p_C) const = 0;
  // That of errors at best, in the term's unit; `distance_m` as above.
  virtual double LeastDeviation(double distance_m) const = 0;

  const std::vector<Eigen::Vector3d>& points_L() const { return points_L_; }

 private:
  struct Kept {
    std::size_t point = 0;
    double r = 0;
  };

  std::vector<Eigen::Vector3d> points_L_;
  double weight_;
  std::vector<Kept> kept_;
  double deviation_ = 1;
  double distance_m_ = 0;
};

}  // namespace tsdfpp
