// Marching cubes as docs/map.md says it, one voxel at a time and without a table: the polygons of a
// cube are traced over its six faces. How they are cut into triangles is left open.
#pragma once

#include <algorithm>
#include <array>
#include <map>
#include <optional>
#include <tuple>
#include <utility>
#include <vector>

#include "mapper/volume/tsdf_block.h"

namespace tsdfpp::reference {

// An edge of a cube: its lower corner (bit x + 2 y + 4 z) and its axis.
struct CubeEdgeAt {
  int corner = 0;
  int axis = 0;
  auto operator<=>(const CubeEdgeAt&) const = default;
};
using CubePolygon = std::vector<CubeEdgeAt>;

// Place of a corner or of an edge's middle, in half cubes.
inline Eigen::Vector3i HalfCubes(int corner) {
  return {2 * (corner & 1), corner & 2, (corner >> 1) & 2};
}
inline Eigen::Vector3i HalfCubes(const CubeEdgeAt& edge) {
  return HalfCubes(edge.corner) + Eigen::Vector3i(edge.axis == 0, edge.axis == 1, edge.axis == 2);
}

// The closed polygons in which the surface cuts a cube whose inside corners are these,
// counter-clockwise seen from outside the solid. On each face of the cube a segment leads from one
// crossed edge to the other; where all four are crossed, a segment cuts off each inside corner.
inline std::vector<CubePolygon> CubePolygons(unsigned inside) {
  const auto is_inside = [&](int corner) {
    return ((inside >> static_cast<unsigned>(corner)) & 1U) != 0;
  };
  std::map<CubeEdgeAt, CubeEdgeAt> next;
  // The segment between two edges of a face, with the inside on its right seen from outside the
  // cube: the polygon then goes on into the cube on its left, which is counter-clockwise.
  const auto add_segment = [&](CubeEdgeAt a, CubeEdgeAt b, const Eigen::Vector3i& outward) {
    const int other = a.corner | (1 << a.axis);
    const int solid = is_inside(a.corner) ? a.corner : other;
    const Eigen::Vector3i right = (HalfCubes(b) - HalfCubes(a)).cross(outward);
    if (right.dot(HalfCubes(solid) - HalfCubes(a)) < 0) std::swap(a, b);
    next[a] = b;
  };
  for (int axis = 0; axis < 3; ++axis) {
    for (int side = 0; side < 2; ++side) {
      Eigen::Vector3i outward = Eigen::Vector3i::Zero();
      outward[axis] = 2 * side - 1;
      std::vector<CubeEdgeAt> crossed;
      for (int corner = 0; corner < 8; ++corner) {
        if (((corner >> axis) & 1) != side) continue;
        for (int along = 0; along < 3; ++along) {
          const int other = corner | (1 << along);
          if (along == axis || other == corner) continue;
          if (is_inside(corner) != is_inside(other)) crossed.push_back({corner, along});
        }
      }
      if (crossed.size() == 2) add_segment(crossed[0], crossed[1], outward);
      if (crossed.size() < 4) continue;
      for (int corner = 0; corner < 8; ++corner) {
        if (((corner >> axis) & 1) != side || !is_inside(corner)) continue;
        std::vector<CubeEdgeAt> around;
        for (const CubeEdgeAt& edge : crossed) {
          if (edge.corner == corner || (edge.corner | (1 << edge.axis)) == corner) {
            around.push_back(edge);
          }
        }
        add_segment(around.at(0), around.at(1), outward);
      }
    }
  }
  std::vector<CubePolygon> polygons;
  while (!next.empty()) {
    CubePolygon& polygon = polygons.emplace_back();
    for (auto at = next.begin(); at != next.end(); at = next.find(polygon.back())) {
      polygon.push_back(at->second);
      next.erase(at);
    }
  }
  return polygons;
}

// Vertices by block, place in the block and axis; polygons by block and the cube's place.
struct PlainSurface {
  std::vector<Eigen::Vector3f> vertices;
  std::vector<Colour> colours;
  std::vector<std::vector<std::vector<std::uint32_t>>> polygons_of_cubes;
};

inline PlainSurface PlainMesh(const TsdfGrid& grid, float voxel) {
  // (block, place, axis) of the edge that starts at a voxel.
  using EdgeKey = std::tuple<Index3, int, int>;
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
  std::vector<std::vector<std::vector<EdgeKey>>> polygons_of_cubes;
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
      auto& polygons = polygons_of_cubes.emplace_back();
      for (const CubePolygon& polygon : CubePolygons(inside)) {
        auto& keys = polygons.emplace_back();
        for (const CubeEdgeAt& edge : polygon) {
          const Index3 v = corner_of(cube, edge.corner);
          keys.emplace_back(BlockOf(v), PlaceInBlock(v), edge.axis);
          vertices[keys.back()] = 0;
        }
      }
    }
  }

  PlainSurface surface;
  for (auto& [key, number] : vertices) {
    number = static_cast<std::uint32_t>(surface.vertices.size());
    const auto& [block, place, axis] = key;
    const Index3 v = VoxelAt(block, place);
    const Value a = *value_at(v);
    const Value b = *value_at(v + Index3{axis == 0, axis == 1, axis == 2});
    const float t = a.distance / (a.distance - b.distance);
    Eigen::Vector3f p(static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z));
    p[axis] += t;
    surface.vertices.emplace_back(p * voxel);
    // A side without a colour takes the other's; neither has one: grey.
    const FixedColour grey{32768, 32768, 32768};
    const FixedColour from = a.coloured ? a.colour : (b.coloured ? b.colour : grey);
    const FixedColour to = b.coloured ? b.colour : from;
    Colour colour;
    for (std::size_t c = 0; c < 3; ++c) {
      const float mean = static_cast<float>(from[c]) * (1 - t) + static_cast<float>(to[c]) * t;
      colour[c] = static_cast<std::uint8_t>(std::min(255, (static_cast<int>(mean) + 128) / 256));
    }
    surface.colours.push_back(colour);
  }
  for (const auto& polygons : polygons_of_cubes) {
    auto& numbered = surface.polygons_of_cubes.emplace_back();
    for (const auto& keys : polygons) {
      auto& polygon = numbered.emplace_back();
      for (const EdgeKey& key : keys) polygon.push_back(vertices.at(key));
    }
  }
  return surface;
}

}  // namespace tsdfpp::reference
