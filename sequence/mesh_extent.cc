#include "sequence/mesh_extent.h"

#include <algorithm>

namespace tsdfpp {

MeshExtent ExtentOf(const TriangleMesh& mesh) {
  MeshExtent extent;
  if (mesh.vertices.empty()) return extent;
  extent.min = extent.max = mesh.vertices.front().cast<double>();
  for (const Eigen::Vector3f& vertex : mesh.vertices) {
    extent.min = extent.min.cwiseMin(vertex.cast<double>());
    extent.max = extent.max.cwiseMax(vertex.cast<double>());
  }
  // An end of the longest chord is at least (chord - radius) from any centre, so with a first long
  // chord most vertices need not be compared.
  const Eigen::Vector3d centre = (extent.min + extent.max) / 2;
  const auto farthest_from = [&](const Eigen::Vector3d& point) {
    return std::max_element(mesh.vertices.begin(), mesh.vertices.end(),
                            [&](const Eigen::Vector3f& a, const Eigen::Vector3f& b) {
                              return (a.cast<double>() - point).squaredNorm() <
                                     (b.cast<double>() - point).squaredNorm();
                            })
        ->cast<double>();
  };
  const Eigen::Vector3d first = farthest_from(centre);
  const double radius = (first - centre).norm();
  const double chord = (farthest_from(first) - first).norm();
  std::vector<Eigen::Vector3d> ends;
  for (const Eigen::Vector3f& vertex : mesh.vertices) {
    const Eigen::Vector3d point = vertex.cast<double>();
    if ((point - centre).norm() >= (chord - radius) * (1 - 1e-9)) ends.push_back(point);
  }
  double squared = chord * chord;
  for (std::size_t i = 0; i < ends.size(); ++i) {
    for (std::size_t j = i + 1; j < ends.size(); ++j) {
      squared = std::max(squared, (ends[i] - ends[j]).squaredNorm());
    }
  }
  extent.diameter = std::sqrt(squared);
  return extent;
}

}  // namespace tsdfpp
