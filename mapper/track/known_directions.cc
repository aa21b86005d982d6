#include "mapper/track/known_directions.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

namespace tsdfpp {
namespace {

// Of the shares below which a share is none: keeps directions of which nothing speaks apart from
// rounding.
constexpr double kNoShare = 1e-9;

// What is known of turns while any shift is free.
Eigen::Matrix3d TurnsOf(const Matrix6& H) {
  const Eigen::Matrix3d floor = kNoShare * Eigen::Matrix3d::Identity();
  const Eigen::Matrix3d shifts = H.topLeftCorner<3, 3>();
  const Eigen::Matrix3d both = H.topRightCorner<3, 3>();
  const Eigen::Matrix3d schur =
      H.bottomRightCorner<3, 3>() - both.transpose() * (shifts + floor).ldlt().solve(both);
  return (schur + schur.transpose()) / 2;
}

}  // namespace

KnownDirections DirectionsOf(const Matrix6& information) {
  KnownDirections known;
  const double weights = information.topLeftCorner<3, 3>().trace();
  if (!(weights > 0) || !information.allFinite()) return known;
  const Matrix6 H = information / weights;
  using Solver = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>;
  const Solver of_shifts(Eigen::Matrix3d(H.topLeftCorner<3, 3>()));
  known.shift_shares = of_shifts.eigenvalues().cwiseMax(0);
  known.shifts = of_shifts.eigenvectors();
  const Solver of_turns(TurnsOf(H));
  known.turn_shares = of_turns.eigenvalues().cwiseMax(0);
  known.turns = of_turns.eigenvectors();
  return known;
}

AlongDirections Along(const KnownDirections& known, const Matrix6& information,
                      const Matrix6& of_others) {
  AlongDirections along;
  const double weights = information.topLeftCorner<3, 3>().trace();
  if (!(weights > 0) || !information.allFinite() || !of_others.allFinite()) return along;
  const Eigen::Matrix3d shifts = of_others.topLeftCorner<3, 3>();
  const Eigen::Matrix3d turns =
      weights * (TurnsOf((information + of_others) / weights) - TurnsOf(information / weights));
  for (int i = 0; i < 3; ++i) {
    along.shifts[i] = std::max(0.0, known.shifts.col(i).dot(shifts * known.shifts.col(i)));
    along.turns[i] = std::max(0.0, known.turns.col(i).dot(turns * known.turns.col(i)));
  }
  return along;
}

}  // namespace tsdfpp
