// Marching cubes over sparse voxels, as docs/map.md says it, a cube at a time.
#pragma once

#include <array>
#include <cstdint>
#include <unordered_map>

#include "core/types.h"
#include "mapper/mesh/marching_cubes.h"
#include "tests/reference/sparse_voxels.h"

namespace tsdfpp::reference {

// Vertices in the lattice's frame, metres; no colours, no ids.
template <typename Voxel>
TriangleMesh MeshOf(const SparseVoxels<Voxel>& voxels, float voxel_m) {
  TriangleMesh mesh;
  std::unordered_map<std::uint64_t, std::uint32_t> vertices;  // by lower voxel and axis
  const auto key_of = [](const Eigen::Vector3i& v, unsigned axis) {
    constexpr int kOffset = 1 << 19;
    std::uint64_t key = 0;
    for (int a = 0; a < 3; ++a) key = key << 20U | static_cast<std::uint64_t>(v[a] + kOffset);
    return key << 2U | axis;
  };
  for (const auto& [key, block] : voxels.blocks()) {
    const CubesOfBlock<Voxel> cubes(voxels, key);
    for (std::size_t place = 0; place < block.size(); ++place) {
      if (!block[place].observed()) continue;
      unsigned inside = 0;
      bool observed = true;
      for (int corner = 0; corner < 8 && observed; ++corner) {
        const Voxel& value = cubes.Corner(place, corner);
        observed = value.observed();
        if (value.distance < 0) inside |= 1U << static_cast<unsigned>(corner);
      }
      if (!observed) continue;
      for (const auto& triangle : CubeTriangles(inside)) {
        std::array<std::uint32_t, 3> corners{};
        for (std::size_t i = 0; i < 3; ++i) {
          const int lower = triangle[i] / 3;
          const unsigned axis = triangle[i] % 3U;
          const Eigen::Vector3i v = SparseVoxels<Voxel>::VoxelAt(key, place) +
                                    Eigen::Vector3i(lower & 1, (lower >> 1) & 1, lower >> 2);
          const auto [found, is_new] =
              vertices.emplace(key_of(v, axis), static_cast<std::uint32_t>(mesh.vertices.size()));
          corners[i] = found->second;
          if (!is_new) continue;
          const float from = cubes.Corner(place, lower).distance;
          const float to = cubes.Corner(place, lower | (1 << axis)).distance;
          Eigen::Vector3f p = v.cast<float>();
          p[axis] += from / (from - to);
          mesh.vertices.emplace_back(p * voxel_m);
        }
        mesh.triangles.push_back(corners);
      }
    }
  }
  return mesh;
}

// The voxel nearest to a point given in metres.
inline Eigen::Vector3i NearestVoxel(const Eigen::Vector3f& p, float voxel_m) {
  return (p / voxel_m + Eigen::Vector3f::Constant(0.5F)).array().floor().matrix().cast<int>();
}

}  // namespace tsdfpp::reference
