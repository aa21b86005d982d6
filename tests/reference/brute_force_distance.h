// Oracle for surface distances: every triangle, double precision, nearest point by the region of
// the triangle's plane that the query falls into (Ericson, Real-Time Collision Detection, 5.1.5).
#pragma once

#include <limits>

#include "core/types.h"

namespace tsdfpp::reference {

inline Eigen::Vector3d NearestOnTriangle(const Eigen::Vector3d& p, const Eigen::Vector3d& a,
                                         const Eigen::Vector3d& b, const Eigen::Vector3d& c) {
  const Eigen::Vector3d ab = b - a;
  const Eigen::Vector3d ac = c - a;
  const double d1 = ab.dot(p - a);
  const double d2 = ac.dot(p - a);
  if (d1 <= 0 && d2 <= 0) return a;
  const double d3 = ab.dot(p - b);
  const double d4 = ac.dot(p - b);
  if (d3 >= 0 && d4 <= d3) return b;
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) return a + d1 / (d1 - d3) * ab;
  const double d5 = ab.dot(p - c);
  const double d6 = ac.dot(p - c);
  if (d6 >= 0 && d5 <= d6) return c;
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) return a + d2 / (d2 - d6) * ac;
  const double va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) {
    return b + (d4 - d3) / ((d4 - d3) + (d5 - d6)) * (c - b);
  }
  const double scale = 1 / (va + vb + vc);
  return a + vb * scale * ab + vc * scale * ac;
}

// Distance from p to the triangles that `keep(index)` admits; infinite where there are none.
template <typename Keep>
double DistanceToMesh(const Eigen::Vector3f& point, const TriangleMesh& mesh, const Keep& keep) {
  double smallest = std::numeric_limits<double>::infinity();
  const Eigen::Vector3d p = point.cast<double>();
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    if (!keep(t)) continue;
    const auto& corners = mesh.triangles[t];
    const Eigen::Vector3d nearest = NearestOnTriangle(p, mesh.vertices[corners[0]].cast<double>(),
                                                      mesh.vertices[corners[1]].cast<double>(),
                                                      mesh.vertices[corners[2]].cast<double>());
    smallest = std::min(smallest, (p - nearest).norm());
  }
  return smallest;
}

}  // namespace tsdfpp::reference
