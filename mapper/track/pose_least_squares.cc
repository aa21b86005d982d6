#include "mapper/track/pose_least_squares.h"

#include <Eigen/Cholesky>
#include <cmath>

namespace tsdfpp {
namespace {

// Marquardt's factor on the diagonal: at first, when a step is taken, when it is refused, and where
// the search gives up.
constexpr double kFirstDamping = 1e-4;
constexpr double kLessDamping = 0.1;
constexpr double kMoreDamping = 10;
constexpr double kMostDamping = 1e8;
// Of the mean of the diagonal: keeps directions of which nothing speaks from dividing by nothing.
constexpr double kFloor = 1e-9;

// The terms with the prior.
NormalEquations WithPrior(const NormalEquations& terms, const Pose& T, const MotionFrame& frame,
                          const MotionPrior& prior) {
  NormalEquations sum = terms;
  const Vector6 off = frame.LengthsOf(T * prior.expected.inverse());
  sum.H += prior.P;
  sum.g += prior.P * off;
  sum.cost += 0.5 * off.dot(prior.P * off);
  return sum;
}

}  // namespace

LeastSquaresResult MinimiseOverPose(const std::function<NormalEquations(const Pose&)>& terms,
                                    const Pose& start, const MotionFrame& frame,
                                    const MotionPrior& prior, const LeastSquaresOptions& options) {
  LeastSquaresResult result;
  result.T = start;
  result.at = terms(start);
  NormalEquations here = WithPrior(result.at, start, frame, prior);
  double damping = kFirstDamping;
  while (result.iterations < options.max_iterations) {
    ++result.iterations;
    const double floor = kFloor * here.H.trace() / 6;
    if (!std::isfinite(here.cost) || !(floor > 0)) return result;
    Matrix6 damped = here.H;
    damped.diagonal() += damping * here.H.diagonal() + Vector6::Constant(floor);
    const Vector6 step = -damped.ldlt().solve(here.g);
    if (!step.allFinite()) return result;
    Pose T = frame.MotionOf(step) * result.T;
    // A rotation again after a product of many.
    T.linear() = Eigen::Quaterniond(T.linear()).normalized().toRotationMatrix();
    result.last_step_m = step.cwiseAbs().maxCoeff();
    const bool is_small = result.last_step_m < options.settled_m;
    const NormalEquations there = terms(T);
    const NormalEquations with_prior = WithPrior(there, T, frame, prior);
    if (with_prior.cost <= here.cost) {
      result.T = T;
      result.at = there;
      here = with_prior;
      damping *= kLessDamping;
    } else {
      damping *= kMoreDamping;
    }
    // A refused step that is as small as this says that the cost jumps more than it still falls.
    if (is_small || damping > kMostDamping) {
      result.converged = is_small;
      return result;
    }
  }
  return result;
}

}  // namespace tsdfpp
