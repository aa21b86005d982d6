#include "mapper/track/sdf_registration.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>

namespace tsdfpp {
namespace {

// Segments smaller than this say nothing about a turn, but a length is needed all the same.
constexpr double kLeastRadius_voxels = 1;
// A deviation that is taken for real, voxels: exact data would else make outliers of every edge.
constexpr double kLeastDeviation_voxels = 0.02;
// A search that ran out of iterations is as good as settled where its steps are no longer than
// this. While many points are outliers Huber's function makes steps short and of one length; an
// object that was refused for it, step by step the same, was lost where it was pushed along.
constexpr double kNearlySettled_voxels = 0.1;

// About the segment's centroid, with the root of the mean squared distance from it as radius.
MotionFrame FrameOf(const SdfRegistration& task) {
  MotionFrame frame;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double squares = 0;
  for (const SegmentPoint& point : task.points) sum += point.p_C.cast<double>();
  const auto count = static_cast<double>(task.points.size());
  const Eigen::Vector3d centre_C = sum / count;
  for (const SegmentPoint& point : task.points) {
    squares += (point.p_C.cast<double>() - centre_C).squaredNorm();
  }
  frame.centre = task.T_LC_expected * centre_C;
  frame.radius_m = std::max(std::sqrt(squares / count), kLeastRadius_voxels * task.voxel_m);
  return frame;
}

// Of the shares below which a share is none: keeps directions of which nothing speaks apart from
// rounding.
constexpr double kNoShare = 1e-9;

Eigen::Matrix3d PriorOf(const Eigen::Vector3d& shares, const Eigen::Matrix3d& directions,
                        double weak_share) {
  const Eigen::Vector3d lacking = (weak_share - shares.array()).max(0);
  return directions * lacking.asDiagonal() * directions.transpose();
}

MotionPrior PriorFor(const Matrix6& H, const Pose& expected, double weak_share) {
  MotionPrior prior;
  prior.expected = expected;
  const KnownDirections known = DirectionsOf(H);
  const double weights = std::max(1.0, H.topLeftCorner<3, 3>().trace());
  prior.P.topLeftCorner<3, 3>() = weights * PriorOf(known.shift_shares, known.shifts, weak_share);
  prior.P.bottomRightCorner<3, 3>() = weights * PriorOf(known.turn_shares, known.turns, weak_share);
  return prior;
}

DistanceTerm TermOf(const SdfRegistration& task, const MotionFrame& frame,
                    const SdfTrackConfig& config, std::size_t stride) {
  return {*task.model, task.points, frame, task.voxel_m, task.camera, config, stride};
}

// Passes of the coarse search from one seed: what is kept of the points holds near where it was
// kept.
constexpr int kCoarsePasses = 2;

// From every seed, with a share of the points: the pose of least cost, in the result.
void RegisterCoarsely(const SdfRegistration& task, const SdfTrackConfig& config,
                      LeastSquaresOptions options, SdfRegistrationResult& result) {
  options.settled_m *= 10;
  const std::size_t stride =
      std::max<std::size_t>(1, task.points.size() / static_cast<std::size_t>(config.coarse_points));
  DistanceTerm coarse = TermOf(task, result.frame, config, stride);
  const auto sums = [&](const Pose& T) { return coarse.Sums(T); };
  double least = std::numeric_limits<double>::infinity();
  const auto try_seed = [&](const Pose& seed) {
    Pose T_LC = seed;
    for (int pass = 0; pass < kCoarsePasses; ++pass) {
      coarse.KeepAt(T_LC);
      const MotionPrior prior =
          PriorFor(coarse.Sums(T_LC).H, task.T_LC_expected, config.weak_share);
      const LeastSquaresResult found = MinimiseOverPose(sums, T_LC, result.frame, prior, options);
      result.iterations += found.iterations;
      T_LC = found.T;
    }
    coarse.KeepAt(T_LC);
    const double cost = coarse.Sums(T_LC).cost;
    if (!(cost < least)) return;
    least = cost;
    result.T_LC = T_LC;
  };
  if (!task.is_near) try_seed(task.T_LC_expected);
  for (const Pose& seed : task.T_LC_seeds) try_seed(seed);
}

// Of the fine search: with a share of the points, and then with all of them, or with all alone.
constexpr int kMiddlePasses = 2;
constexpr int kLastPasses = 1;
constexpr int kPassesOfAll = kMiddlePasses + kLastPasses;

// As narrow as residuals of that deviation ask for.
double HuberFor(double deviation_m, double voxel_m, const SdfTrackConfig& config) {
  return std::min(
      config.huber_voxels * voxel_m,
      config.huber_deviations * std::max(deviation_m, kLeastDeviation_voxels * voxel_m));
}

LeastSquaresResult RunPasses(const SdfRegistration& task, const SdfTrackConfig& config,
                             const LeastSquaresOptions& options, int passes, DistanceTerm& term,
                             SdfRegistrationResult& result) {
  MotionPrior prior;
  LeastSquaresResult found;
  for (int pass = 0; pass < passes; ++pass) {
    term.KeepAt(result.T_LC);
    term.SetHuber(HuberFor(term.KeptDeviation_m(), task.voxel_m, config));
    if (pass == 0) {
      prior = PriorFor(term.Sums(result.T_LC).H, task.T_LC_expected, config.weak_share);
    }
    found = MinimiseOverPose([&](const Pose& T) { return term.Sums(T); }, result.T_LC, result.frame,
                             prior, options);
    result.iterations += found.iterations;
    result.T_LC = found.T;
  }
  return found;
}

LeastSquaresResult RegisterFinely(const SdfRegistration& task, const SdfTrackConfig& config,
                                  const LeastSquaresOptions& options, DistanceTerm& all,
                                  SdfRegistrationResult& result) {
  const std::size_t stride = task.points.size() / static_cast<std::size_t>(config.middle_points);
  if (stride < 2) return RunPasses(task, config, options, kPassesOfAll, all, result);
  DistanceTerm some = TermOf(task, result.frame, config, stride);
  RunPasses(task, config, options, kMiddlePasses, some, result);
  return RunPasses(task, config, options, kLastPasses, all, result);
}

}  // namespace

KnownDirections DirectionsOf(const Matrix6& information) {
  KnownDirections known;
  const double weights = information.topLeftCorner<3, 3>().trace();
  if (!(weights > 0) || !information.allFinite()) return known;
  const Matrix6 H = information / weights;
  using Solver = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>;
  const Eigen::Matrix3d shifts = H.topLeftCorner<3, 3>();
  const Solver of_shifts(shifts);
  known.shift_shares = of_shifts.eigenvalues().cwiseMax(0);
  known.shifts = of_shifts.eigenvectors();
  const Eigen::Matrix3d floor = kNoShare * Eigen::Matrix3d::Identity();
  const Eigen::Matrix3d both = H.topRightCorner<3, 3>();
  const Eigen::Matrix3d schur =
      H.bottomRightCorner<3, 3>() - both.transpose() * (shifts + floor).ldlt().solve(both);
  const Solver of_turns((schur + schur.transpose()) / 2);
  known.turn_shares = of_turns.eigenvalues().cwiseMax(0);
  known.turns = of_turns.eigenvectors();
  return known;
}

OtherPlace ComparePlace(const SdfRegistration& task, const Pose& T_LC,
                        const SdfRegistrationResult& found, const SdfTrackConfig& config) {
  DistanceTerm term = TermOf(task, found.frame, config, 1);
  term.SetHuber(HuberFor(found.counts.deviation_m, task.voxel_m, config));
  const auto cost_at = [&](const Pose& T) {
    term.KeepAt(T);
    return term.Sums(T).cost;
  };
  const double cost_found = cost_at(found.T_LC);
  OtherPlace other;
  other.cost_ratio = cost_at(T_LC) / cost_found;
  other.counts = term.Count(T_LC);
  return other;
}

SdfRegistrationResult RegisterToDistances(const SdfRegistration& task,
                                          const SdfTrackConfig& config) {
  SdfRegistrationResult result;
  result.T_LC = task.T_LC_expected;
  if (task.points.empty()) return result;
  result.frame = FrameOf(task);
  if (!result.frame.centre.allFinite() || !std::isfinite(result.frame.radius_m)) return result;
  const LeastSquaresOptions options{config.max_iterations, config.settled_voxels * task.voxel_m};
  RegisterCoarsely(task, config, options, result);
  DistanceTerm fine = TermOf(task, result.frame, config, 1);
  const LeastSquaresResult found = RegisterFinely(task, config, options, fine, result);
  const bool is_settled =
      found.converged || found.last_step_m < kNearlySettled_voxels * task.voxel_m;
  // Where no point has a distance there is nothing to be at rest on.
  result.converged = is_settled && found.at.H.trace() > 0;
  result.counts = fine.Count(found.T);
  result.information = found.at.H;
  result.known = DirectionsOf(found.at.H);
  const Matrix6 floor = (1e-9 + kNoShare * found.at.H.trace() / 6) * Matrix6::Identity();
  const Matrix6 information = found.at.H + floor;
  const double deviation_m = result.counts.deviation_m;
  result.covariance = deviation_m * deviation_m * information.ldlt().solve(Matrix6::Identity());
  return result;
}

}  // namespace tsdfpp
