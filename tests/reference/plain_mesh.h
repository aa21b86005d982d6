// Marching cubes as docs/map.md says it, one voxel at a time; only the order of the result is that
// of the fast code: by block, then by place in the block.
#pragma once

#include <map>
#include <optional>
#include <set>
#include <tuple>
#include <vector>

#include "mapper/marching_cubes.h"

namespace tsdfpp::reference {

// (block, place, axis) of the edge that starts at a voxel.
using EdgeKey = std::tuple<Index3, int, int>;

inline TriangleMesh PlainMesh(const TsdfGrid& grid, float voxel) {
  struct Value {
    float distance;
    FixedColour colour;
    bool coloured;
  };
  const auto value_at = [&](const Index3& v) -> std::optional<Value> {
    const TsdfBlock* block = grid.Find(BlockOf(v));
    const auto i = static_cast<std::size_t>(PlaceInBlock(v));
    if (block == nullptr || block->weight[i] <= 0) return std::nullopt;
    return Value{block->distance[i], block->FixedColourAt(i), block->ColourCount(i) > 0};
  };
  const auto corner_of = [](const Index3& cube, int corner) {
    return cube + Index3{corner & 1, (corner >> 1) & 1, corner >> 2};
  };

  std::vector<Index3> blocks;
  for (const auto& entry : grid.entries()) blocks.push_back(entry.index);
  std::sort(blocks.begin(), blocks.end());
  std::vector<std::array<EdgeKey, 3>> triangles;
  std::map<EdgeKey, std::uint32_t> vertices;
  for (const Index3& block : blocks) {
    for (int place = 0; place < kBlockVoxels; ++place) {
      const Index3 cube = VoxelAt(block, place);
      unsigned inside = 0;
      bool observed = true;
      for (int corner = 0; corner < 8; ++corner) {
        const auto value = value_at(corner_of(cube, corner));
        observed = observed && value;
        if (value && value->distance < 0) inside |= 1U << corner;
      }
      if (!observed) continue;
      for (const auto& triangle : CubeTriangles(inside)) {
        std::array<EdgeKey, 3> corners;
        for (std::size_t i = 0; i < 3; ++i) {
          const Index3 v = corner_of(cube, triangle[i] / 3);
          corners[i] = {BlockOf(v), PlaceInBlock(v), triangle[i] % 3};
          vertices[corners[i]] = 0;
        }
        triangles.push_back(corners);
      }
    }
  }

  TriangleMesh mesh;
  for (auto& [key, number] : vertices) {
    number = static_cast<std::uint32_t>(mesh.vertices.size());
    const auto& [block, place, axis] = key;
    const Index3 v = VoxelAt(block, place);
    const Value a = *value_at(v);
    const Value b = *value_at(v + Index3{axis == 0, axis == 1, axis == 2});
    const float t = a.distance / (a.distance - b.distance);
    Eigen::Vector3f p(static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z));
    p[axis] += t;
    mesh.vertices.emplace_back(p * voxel);
    // A side without a colour takes the other's; neither has one: grey.
    const FixedColour grey{32768, 32768, 32768};
    const FixedColour from = a.coloured ? a.colour : (b.coloured ? b.colour : grey);
    const FixedColour to = b.coloured ? b.colour : from;
    Colour colour;
    for (std::size_t c = 0; c < 3; ++c) {
      const float mean = static_cast<float>(from[c]) * (1 - t) + static_cast<float>(to[c]) * t;
      colour[c] = static_cast<std::uint8_t>(std::min(255, (static_cast<int>(mean) + 128) / 256));
    }
    mesh.colours.push_back(colour);
  }
  for (const auto& triangle : triangles) {
    mesh.triangles.push_back({vertices[triangle[0]], vertices[triangle[1]], vertices[triangle[2]]});
  }
  return mesh;
}

}  // namespace tsdfpp::reference
