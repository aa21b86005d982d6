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

// Shares and directions of what the sums know; their translations' part has the points' weights as
// its trace.
void Analyse(const Matrix6& H, Vector6& shares, Matrix6& directions) {
  const double weights = H.topLeftCorner<3, 3>().trace();
  if (!(weights > 0)) return;
  const Eigen::SelfAdjointEigenSolver<Matrix6> solver(H / weights);
  shares = solver.eigenvalues().cwiseMax(0);
  directions = solver.eigenvectors();
}

MotionPrior PriorFor(const Matrix6& H, const Pose& expected, double weak_share) {
  MotionPrior prior;
  prior.expected = expected;
  Vector6 shares = Vector6::Zero();
  Matrix6 directions = Matrix6::Identity();
  Analyse(H, shares, directions);
  const double weights = std::max(1.0, H.topLeftCorner<3, 3>().trace());
  for (Eigen::Index i = 0; i < 6; ++i) {
    const double lacking = weak_share - shares[i];
    if (lacking <= 0) continue;
    const Vector6 direction = directions.col(i);
    prior.P += lacking * weights * direction * direction.transpose();
  }
  return prior;
}

}  // namespace

SdfRegistrationResult RegisterToDistances(const SdfRegistration& task,
                                          const SdfTrackConfig& config) {
  SdfRegistrationResult result;
  result.T_LC = task.T_LC_expected;
  if (task.points.empty()) return result;
  result.frame = FrameOf(task);
  if (!result.frame.centre.allFinite() || !std::isfinite(result.frame.radius_m)) return result;
  const LeastSquaresOptions options{config.max_iterations, config.settled_voxels * task.voxel_m};
  const auto term_of = [&](std::size_t stride) {
    return DistanceTerm(*task.model, task.points, result.frame, task.voxel_m, task.camera, config,
                        stride);
  };

  // Coarse: from every seed.
  const std::size_t stride =
      std::max<std::size_t>(1, task.points.size() / static_cast<std::size_t>(config.coarse_points));
  const DistanceTerm coarse = term_of(stride);
  const auto coarse_sums = [&](const Pose& T) { return coarse.Sums(T); };
  LeastSquaresOptions coarse_options = options;
  coarse_options.settled_m *= 10;
  double least = std::numeric_limits<double>::infinity();
  const auto try_seed = [&](const Pose& seed) {
    const MotionPrior prior = PriorFor(coarse.Sums(seed).H, task.T_LC_expected, config.weak_share);
    const LeastSquaresResult found =
        MinimiseOverPose(coarse_sums, seed, result.frame, prior, coarse_options);
    result.iterations += found.iterations;
    if (!(found.at.cost < least)) return;
    least = found.at.cost;
    result.T_LC = found.T;
  };
  if (!task.is_near) try_seed(task.T_LC_expected);
  for (const Pose& seed : task.T_LC_seeds) try_seed(seed);

  // Fine: all points, with as narrow a Huber function as the residuals ask for. Sags hold near
  // where they were read, so they are read once more.
  DistanceTerm fine = term_of(1);
  MotionPrior prior;
  LeastSquaresResult found;
  for (int pass = 0; pass < (config.curved ? 2 : 1); ++pass) {
    if (config.curved) fine.SetSags(result.T_LC);
    const double deviation_m =
        fine.RobustDeviation_m(result.T_LC, kLeastDeviation_voxels * task.voxel_m);
    fine.SetHuber(
        std::min(config.huber_voxels * task.voxel_m, config.huber_deviations * deviation_m));
    if (pass == 0)
      prior = PriorFor(fine.Sums(result.T_LC).H, task.T_LC_expected, config.weak_share);
    found = MinimiseOverPose([&](const Pose& T) { return fine.Sums(T); }, result.T_LC, result.frame,
                             prior, options);
    result.iterations += found.iterations;
    result.T_LC = found.T;
  }
  result.converged = found.converged;
  result.counts = fine.Count(found.T);
  result.deviation_m = fine.RobustDeviation_m(found.T, 0);
  result.information = found.at.H;
  Analyse(found.at.H, result.shares, result.directions);
  const Matrix6 all = found.at.H + prior.P + 1e-9 * Matrix6::Identity();
  result.covariance =
      result.deviation_m * result.deviation_m * all.ldlt().solve(Matrix6::Identity());
  return result;
}

}  // namespace tsdfpp
