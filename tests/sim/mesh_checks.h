// What a closed, outward mesh is, written without any code of sim/.
#pragma once

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <map>
#include <string>
#include <utility>

#include "sim/models/mesh_shapes.h"

namespace tsdfpp {

// How many directed edges have no partner that runs the other way, or are there more than once.
inline std::size_t CountOpenEdges(const Shape& shape) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> edges;
  for (const auto& triangle : shape.triangles) {
    for (std::size_t k = 0; k < 3; ++k) ++edges[{triangle[k], triangle[(k + 1) % 3]}];
  }
  std::size_t open = 0;
  for (const auto& [edge, count] : edges) {
    const auto back = edges.find({edge.second, edge.first});
    if (count != 1 || back == edges.end() || back->second != 1) ++open;
  }
  return open;
}

// Six times the volume that the faces enclose, from each face's own tetrahedron.
inline double EnclosedVolume(const Shape& shape) {
  double six = 0;
  for (const auto& [a, b, c] : shape.triangles) {
    Eigen::Matrix3d corners;
    corners << shape.vertices[a], shape.vertices[b], shape.vertices[c];
    six += corners.determinant();
  }
  return six / 6;
}

// How often the mesh winds around a point: 1 inside of a closed outward mesh, 0 outside (the sum of
// the solid angles of all faces, by Van Oosterom and Strackee, over 4 pi).
inline double WindingNumber(const Shape& shape, const Eigen::Vector3d& p) {
  double sum = 0;
  for (const auto& [ia, ib, ic] : shape.triangles) {
    const Eigen::Vector3d a = shape.vertices[ia] - p;
    const Eigen::Vector3d b = shape.vertices[ib] - p;
    const Eigen::Vector3d c = shape.vertices[ic] - p;
    const double la = a.norm();
    const double lb = b.norm();
    const double lc = c.norm();
    sum += 2 * std::atan2(a.dot(b.cross(c)),
                          la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb);
  }
  return sum / (4 * M_PI);
}

inline Eigen::AlignedBox3d BoxAround(const Shape& shape) {
  Eigen::AlignedBox3d box;
  for (const Eigen::Vector3d& vertex : shape.vertices) box.extend(vertex);
  return box;
}

}  // namespace tsdfpp
