// The packed meshes of a report as its page unpacks them.
#pragma once

#include <gtest/gtest.h>
#include <meshoptimizer.h>

#include <cstdint>
#include <string>
#include <vector>

#include "eval/tools/packed_mesh.h"

namespace tsdfpp::test {

struct Unpacked {
  std::vector<PackedVertex> vertices;
  std::vector<std::uint32_t> indices;
};

inline Unpacked Unpack(const std::string& vertex_bytes, std::size_t vertices,
                       const std::string& index_bytes, std::size_t triangles) {
  Unpacked out{std::vector<PackedVertex>(vertices), std::vector<std::uint32_t>(3 * triangles)};
  EXPECT_EQ(meshopt_decodeVertexBuffer(out.vertices.data(), vertices, sizeof(PackedVertex),
                                       reinterpret_cast<const unsigned char*>(vertex_bytes.data()),
                                       vertex_bytes.size()),
            0);
  EXPECT_EQ(meshopt_decodeIndexBuffer(out.indices.data(), out.indices.size(), sizeof(std::uint32_t),
                                      reinterpret_cast<const unsigned char*>(index_bytes.data()),
                                      index_bytes.size()),
            0);
  return out;
}

inline Eigen::Vector3f PlaceOf(const PackedVertex& vertex, const Eigen::Vector3f& origin,
                               float step_m) {
  return origin +
         step_m * Eigen::Vector3f(vertex.position[0], vertex.position[1], vertex.position[2]);
}

inline double AreaOf(const Unpacked& mesh, const PositionGrid& grid) {
  double area = 0;
  for (std::size_t i = 0; i < mesh.indices.size(); i += 3) {
    const auto corner = [&](std::size_t k) {
      return PlaceOf(mesh.vertices[mesh.indices[i + k]], grid.origin, grid.step_m);
    };
    area += 0.5 * (corner(1) - corner(0)).cross(corner(2) - corner(0)).norm();
  }
  return area;
}

}  // namespace tsdfpp::test
