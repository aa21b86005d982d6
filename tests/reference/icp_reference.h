// Point-to-plane registration by brute force, from the paper's eq. (1): every point against every
// vertex, Gauss-Newton with the exact rotation, in double. And its linearised form, which PCL would
// use by default.
#pragma once

#include <Eigen/Dense>
#include <limits>
#include <vector>

#include "core/types.h"

namespace tsdfpp::reference {

struct OrientedPoint {
  Eigen::Vector3d p;
  Eigen::Vector3d n;
};

// The vertices of a mesh with area-weighted normals; all must have a face.
inline std::vector<OrientedPoint> OrientedVertices(const TriangleMesh& mesh) {
  std::vector<OrientedPoint> vertices;
  for (std::uint32_t v = 0; v < mesh.vertices.size(); ++v) {
    vertices.push_back({mesh.vertices[v].cast<double>(), Eigen::Vector3d::Zero()});
  }
  for (const auto& t : mesh.triangles) {
    const Eigen::Vector3d area = (vertices[t[1]].p - vertices[t[0]].p)
                                     .cross(Eigen::Vector3d(vertices[t[2]].p - vertices[t[0]].p));
    for (const std::uint32_t v : t) vertices[v].n += area;
  }
  for (OrientedPoint& vertex : vertices) vertex.n.normalize();
  return vertices;
}

// Rows (p x n, n) and residuals of the pairs (p, the vertex it is matched with).
inline Eigen::Matrix<double, 6, 1> SolveSmallMotion(const std::vector<Eigen::Vector3d>& points,
                                                    const std::vector<OrientedPoint>& matches) {
  Eigen::Matrix<double, 6, 6> A = Eigen::Matrix<double, 6, 6>::Zero();
  Eigen::Matrix<double, 6, 1> b = Eigen::Matrix<double, 6, 1>::Zero();
  for (std::size_t i = 0; i < points.size(); ++i) {
    Eigen::Matrix<double, 6, 1> row;
    row << points[i].cross(matches[i].n), matches[i].n;
    A += row * row.transpose();
    b -= row * (points[i] - matches[i].p).dot(matches[i].n);
  }
  return A.ldlt().solve(b);
}

// The motion whose three angles and shift solve the problem linearised at the identity.
inline Pose LinearisedStep(const std::vector<Eigen::Vector3d>& points,
                           const std::vector<OrientedPoint>& matches) {
  const Eigen::Matrix<double, 6, 1> x = SolveSmallMotion(points, matches);
  Pose step = Pose::Identity();
  step.linear() = (Eigen::AngleAxisd(x[2], Eigen::Vector3d::UnitZ()) *
                   Eigen::AngleAxisd(x[1], Eigen::Vector3d::UnitY()) *
                   Eigen::AngleAxisd(x[0], Eigen::Vector3d::UnitX()))
                      .toRotationMatrix();
  step.translation() = x.tail<3>();
  return step;
}

// T that takes `points` onto the model; matches farther apart than `limit_m` do not count.
inline Pose BruteForceIcp(const std::vector<Eigen::Vector3d>& points,
                          const std::vector<OrientedPoint>& model, double limit_m, int iterations) {
  // About the centroid, or rotation and shift are badly conditioned far from the origin.
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& p : points) centre += p / static_cast<double>(points.size());
  Pose T = Pose::Identity();
  T.translation() = -centre;
  for (int iteration = 0; iteration < iterations; ++iteration) {
    std::vector<Eigen::Vector3d> moved;
    std::vector<OrientedPoint> matches;
    for (const Eigen::Vector3d& point : points) {
      const Eigen::Vector3d p = T * point;
      double nearest = limit_m * limit_m;
      const OrientedPoint* match = nullptr;
      for (const OrientedPoint& vertex : model) {
        const double distance = (vertex.p - centre - p).squaredNorm();
        if (distance > nearest) continue;
        nearest = distance;
        match = &vertex;
      }
      if (match == nullptr) continue;
      moved.push_back(p);
      matches.push_back({match->p - centre, match->n});
    }
    for (int step = 0; step < 3; ++step) {
      const Eigen::Matrix<double, 6, 1> x = SolveSmallMotion(moved, matches);
      Pose delta = Pose::Identity();
      const Eigen::Vector3d turn = x.head<3>();
      if (turn.norm() > 0) {
        delta.linear() = Eigen::AngleAxisd(turn.norm(), turn.normalized()).toRotationMatrix();
      }
      delta.translation() = x.tail<3>();
      for (Eigen::Vector3d& p : moved) p = delta * p;
      T = delta * T;
    }
  }
  return Eigen::Translation3d(centre) * T;
}

}  // namespace tsdfpp::reference
