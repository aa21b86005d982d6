// Shapes by their exact signed distances, and the pose of points on them by brute force: every
// point, plain least squares after Gauss and Newton with numeric differences, in double, no grid.
#pragma once

#include <Eigen/Dense>
#include <functional>
#include <vector>

#include "core/types.h"

namespace tsdfpp::reference {

using DistanceFunction = std::function<double(const Eigen::Vector3d&)>;

inline DistanceFunction SphereDistance(double radius_m) {
  return [=](const Eigen::Vector3d& p) { return p.norm() - radius_m; };
}
inline DistanceFunction TorusDistance(double ring_m, double tube_m) {
  return [=](const Eigen::Vector3d& p) {
    return std::hypot(p.head<2>().norm() - ring_m, p.z()) - tube_m;
  };
}
inline DistanceFunction BoxDistance(const Eigen::Vector3d& half_m) {
  return [=](const Eigen::Vector3d& p) {
    const Eigen::Vector3d q = p.cwiseAbs() - half_m;
    return q.cwiseMax(0).norm() + std::min(q.maxCoeff(), 0.0);
  };
}

// Where the rays from `eye` through a square window of side x side points about the origin, one
// metre wide, first meet the surface; by steps of the distance.
inline std::vector<Eigen::Vector3d> VisiblePoints(const DistanceFunction& distance,
                                                  const Eigen::Vector3d& eye, int side) {
  const Eigen::Vector3d forward = -eye.normalized();
  const Eigen::Vector3d right = forward.unitOrthogonal();
  const Eigen::Vector3d down = forward.cross(right);
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < side * side; ++i) {
    const int row = i / side;
    const double u = (i % side + 0.5) / side - 0.5;
    const double v = (row + 0.5) / side - 0.5;
    const Eigen::Vector3d direction = (u * right + v * down - eye).normalized();
    Eigen::Vector3d p = eye;
    double step = distance(p);
    for (int k = 0; k < 500 && std::abs(step) > 1e-9 && (p - eye).norm() < 2 * eye.norm(); ++k) {
      p += step * direction;
      step = distance(p);
    }
    if (std::abs(step) <= 1e-9) points.push_back(p);
  }
  return points;
}

// exp(x[3..5]) about `centre`, then a shift by x[0..2].
inline Pose SmallMotion(const Eigen::Matrix<double, 6, 1>& x, const Eigen::Vector3d& centre) {
  const Eigen::Vector3d turn = x.tail<3>();
  Pose motion = Pose::Identity();
  if (turn.norm() > 0) {
    motion.linear() = Eigen::AngleAxisd(turn.norm(), turn.normalized()).toRotationMatrix();
  }
  motion.translation() = centre - motion.linear() * centre + x.head<3>();
  return motion;
}

// The pose T for which the sum of distance(T p)^2 is least, from a start near it.
inline Pose BruteForcePose(const DistanceFunction& distance,
                           const std::vector<Eigen::Vector3d>& points, Pose T) {
  constexpr double kStep = 1e-6;
  for (int iteration = 0; iteration < 30; ++iteration) {
    Eigen::Matrix<double, 6, 6> A = 1e-9 * Eigen::Matrix<double, 6, 6>::Identity();
    Eigen::Matrix<double, 6, 1> b = Eigen::Matrix<double, 6, 1>::Zero();
    for (const Eigen::Vector3d& p : points) {
      const Eigen::Vector3d y = T * p;
      Eigen::Matrix<double, 6, 1> J;
      for (int k = 0; k < 6; ++k) {
        Eigen::Matrix<double, 6, 1> x = Eigen::Matrix<double, 6, 1>::Zero();
        x[k] = kStep;
        const Eigen::Vector3d centre = Eigen::Vector3d::Zero();
        J[k] = (distance(SmallMotion(x, centre) * y) - distance(SmallMotion(-x, centre) * y)) /
               (2 * kStep);
      }
      A += J * J.transpose();
      b -= J * distance(y);
    }
    T = SmallMotion(A.ldlt().solve(b), Eigen::Vector3d::Zero()) * T;
  }
  return T;
}

}  // namespace tsdfpp::reference
