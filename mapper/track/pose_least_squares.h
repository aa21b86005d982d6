// Levenberg-Marquardt over one pose, whatever the terms.
#pragma once

#include <functional>
#include <limits>

#include "core/types.h"
#include "mapper/track/motion_frame.h"

namespace tsdfpp {

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
