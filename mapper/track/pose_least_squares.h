// Levenberg-Marquardt over one pose, whatever the terms.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <limits>

#include "core/types.h"

namespace tsdfpp {

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

// A small motion of the object's points y about `centre`, as six lengths: they are shifted by
// x[0..2] and turned by x[3..5] / radius (a rotation vector), so that one number means about as
// much way at the object's surface wherever it stands in x.
struct MotionFrame {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  double radius_m = 1;

  // y -> centre + exp(x[3..5] / radius) (y - centre) + x[0..2].
  Pose MotionOf(const Vector6& x) const;
  // The inverse of MotionOf, for turns of less than pi.
  Vector6 LengthsOf(const Pose& motion) const;
};

// What the terms say of a pose: half the sum of squares, its gradient and its Hessian after Gauss
// and Newton, over MotionFrame's six lengths.
struct NormalEquations {
  Matrix6 H = Matrix6::Zero();
  Vector6 g = Vector6::Zero();
  double cost = 0;
};

// A quadratic that adds to the terms: (x - expected)^T P (x - expected) / 2, x the motion from
// `expected` to the pose.
struct MotionPrior {
  Matrix6 P = Matrix6::Zero();
  Pose expected = Pose::Identity();  // a pose as those of the problem
};

struct LeastSquaresOptions {
  int max_iterations = 15;
  double settled_m = 2e-5;  // a step whose six lengths are all shorter ends the search
};

struct LeastSquaresResult {
  Pose T = Pose::Identity();
  NormalEquations at;  // of the terms alone, at T
  bool converged = false;
  double last_step_m = std::numeric_limits<double>::infinity();  // the longest length of it
  int iterations = 0;
};

// Minimises the terms (and the prior) over poses T by steps T <- MotionOf(x) T. The terms' cost may
// have small jumps; a step that raises the cost is not taken. Stops unconverged after
// max_iterations, or where numbers are not finite. Deterministic.
LeastSquaresResult MinimiseOverPose(const std::function<NormalEquations(const Pose&)>& terms,
                                    const Pose& start, const MotionFrame& frame,
                                    const MotionPrior& prior, const LeastSquaresOptions& options);

}  // namespace tsdfpp
