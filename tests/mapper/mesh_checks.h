// What the tests ask of a mesh that marching cubes made.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <set>
#include <tuple>
#include <vector>

#include "core/types.h"

namespace tsdfpp {

using VoxelKey = std::array<int, 3>;  // (x, y, z)

inline Eigen::Vector3d VertexOf(const TriangleMesh& mesh, std::size_t triangle, int corner) {
  return mesh.vertices[mesh.triangles[triangle][corner]].cast<double>();
}

inline Eigen::Vector3d CentroidOf(const TriangleMesh& mesh, std::size_t t) {
  return (VertexOf(mesh, t, 0) + VertexOf(mesh, t, 1) + VertexOf(mesh, t, 2)) / 3;
}

// Twice the area along the outward normal.
inline Eigen::Vector3d NormalOf(const TriangleMesh& mesh, std::size_t t) {
  return (VertexOf(mesh, t, 1) - VertexOf(mesh, t, 0))
      .cross(VertexOf(mesh, t, 2) - VertexOf(mesh, t, 0));
}

// The cube that a triangle lies in: a triangle is inside one cube, and so is its centroid.
inline VoxelKey CubeOf(const TriangleMesh& mesh, std::size_t t, double voxel_m) {
  const Eigen::Vector3d q = (CentroidOf(mesh, t) / voxel_m).array().floor();
  return {static_cast<int>(q.x()), static_cast<int>(q.y()), static_cast<int>(q.z())};
}

inline std::set<VoxelKey> CubesOf(const TriangleMesh& mesh, double voxel_m) {
  std::set<VoxelKey> cubes;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) cubes.insert(CubeOf(mesh, t, voxel_m));
  return cubes;
}

inline std::set<VoxelKey> Keys(const std::vector<Eigen::Vector3i>& cubes) {
  std::set<VoxelKey> keys;
  for (const Eigen::Vector3i& c : cubes) keys.insert({c.x(), c.y(), c.z()});
  return keys;
}

// Positive where triangles are counter-clockwise seen from outside.
inline double VolumeOf(const TriangleMesh& mesh) {
  double volume = 0;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    volume += VertexOf(mesh, t, 0).dot(VertexOf(mesh, t, 1).cross(VertexOf(mesh, t, 2))) / 6;
  }
  return volume;
}

// The pieces that hang together by vertices at the same place, the largest first.
inline std::vector<TriangleMesh> PiecesOf(const TriangleMesh& mesh) {
  std::map<std::tuple<float, float, float>, std::vector<std::size_t>> at;
  const auto key = [&](std::size_t t, int i) {
    const Eigen::Vector3f& p = mesh.vertices[mesh.triangles[t][i]];
    return std::make_tuple(p.x(), p.y(), p.z());
  };
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    for (int i = 0; i < 3; ++i) at[key(t, i)].push_back(t);
  }
  std::vector<bool> taken(mesh.triangles.size(), false);
  std::vector<TriangleMesh> pieces;
  for (std::size_t seed = 0; seed < mesh.triangles.size(); ++seed) {
    if (taken[seed]) continue;
    TriangleMesh piece;
    piece.vertices = mesh.vertices;
    std::vector<std::size_t> open = {seed};
    taken[seed] = true;
    while (!open.empty()) {
      const std::size_t t = open.back();
      open.pop_back();
      piece.triangles.push_back(mesh.triangles[t]);
      for (int i = 0; i < 3; ++i) {
        for (const std::size_t next : at[key(t, i)]) {
          if (!taken[next]) open.push_back(next);
          taken[next] = true;
        }
      }
    }
    pieces.push_back(std::move(piece));
  }
  std::sort(pieces.begin(), pieces.end(), [](const TriangleMesh& a, const TriangleMesh& b) {
    return a.triangles.size() > b.triangles.size();
  });
  return pieces;
}

// Vertices at the same place made one, whether or not the mesh shares them.
struct Topology {
  using Edge = std::pair<int, int>;
  struct Use {
    int forward = 0;   // triangles that pass it from the lower vertex to the higher
    int backward = 0;  // the other way round
    std::size_t triangle = 0;
  };

  explicit Topology(const TriangleMesh& mesh) {
    std::map<std::tuple<float, float, float>, int> places;
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
      std::array<int, 3> corners{};
      for (int i = 0; i < 3; ++i) {
        const Eigen::Vector3f& p = mesh.vertices[mesh.triangles[t][i]];
        const auto next = static_cast<int>(places.size());
        corners[i] = places.try_emplace({p.x(), p.y(), p.z()}, next).first->second;
        if (corners[i] == next) positions.push_back(p.cast<double>());
      }
      for (int i = 0; i < 3; ++i) {
        const int a = corners[i];
        const int b = corners[(i + 1) % 3];
        Use& use = edges[{std::min(a, b), std::max(a, b)}];
        ++(a < b ? use.forward : use.backward);
        use.triangle = t;
      }
    }
    faces = mesh.triangles.size();
  }

  // V - E + F: 2 for a closed surface like a sphere's.
  int Euler() const {
    return static_cast<int>(positions.size()) - static_cast<int>(edges.size()) +
           static_cast<int>(faces);
  }

  std::vector<Eigen::Vector3d> positions;
  std::map<Edge, Use> edges;
  std::size_t faces = 0;
};

}  // namespace tsdfpp
