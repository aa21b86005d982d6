#include "mapper/marching_cubes.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

namespace tsdfpp {
namespace {

constexpr std::int32_t kNoVertex = -1;
constexpr std::size_t kBlocksPerTask = 16;

using Table = std::array<std::vector<std::array<CubeEdge, 3>>, 256>;

CubeEdge EdgeBetween(int a, int b) {
  const int difference = a ^ b;
  const int axis = difference == 1 ? 0 : (difference == 2 ? 1 : 2);
  return static_cast<CubeEdge>(3 * std::min(a, b) + axis);
}

// On each face, each run of inside corners is cut off by one segment, so inside corners that are
// diagonal on a face are separated, on both sides of the face alike. The segments join to closed
// loops, which are fanned into triangles.
std::vector<std::array<CubeEdge, 3>> TrianglesOf(unsigned inside) {
  // Corners of each face, counter-clockwise seen from outside the cube.
  constexpr std::array<std::array<int, 4>, 6> kFaces{
      {{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}}};
  std::array<int, 24> next;
  next.fill(-1);
  const auto is_inside = [&](int corner) {
    return ((inside >> static_cast<unsigned>(corner)) & 1U) != 0;
  };
  for (const auto& face : kFaces) {
    for (std::size_t i = 0; i < 4; ++i) {
      const int before = face[i];
      const int first = face[(i + 1) % 4];
      if (is_inside(before) || !is_inside(first)) continue;
      std::size_t last = (i + 1) % 4;
      while (is_inside(face[(last + 1) % 4])) last = (last + 1) % 4;
      const CubeEdge entry = EdgeBetween(before, first);
      const CubeEdge exit = EdgeBetween(face[last], face[(last + 1) % 4]);
      next[entry] = exit;
    }
  }
  std::vector<std::array<CubeEdge, 3>> triangles;
  for (std::size_t start = 0; start < next.size(); ++start) {
    if (next[start] < 0) continue;
    std::vector<CubeEdge> loop;
    for (int at = static_cast<int>(start); next[static_cast<std::size_t>(at)] >= 0;) {
      loop.push_back(static_cast<CubeEdge>(at));
      at = std::exchange(next[static_cast<std::size_t>(at)], -1);
    }
    for (std::size_t i = 2; i < loop.size(); ++i) {
      triangles.push_back({loop[0], loop[i - 1], loop[i]});
    }
  }
  return triangles;
}

const Table& CubeTable() {
  static const Table table = [] {
    Table made;
    for (unsigned inside = 0; inside < made.size(); ++inside) made[inside] = TrianglesOf(inside);
    return made;
  }();
  return table;
}

// What one block contributes: the vertices on the edges that it owns (those that start at its
// voxels).
struct BlockVertices {
  std::vector<Eigen::Vector3f> positions;
  std::vector<Colour> colours;
  std::vector<std::int32_t> of_edge;  // 3 * place + axis -> vertex in `positions`; empty if none
  std::vector<std::array<std::uint32_t, 3>> triangles;
  std::uint32_t offset = 0;
};

struct Cell {
  const TsdfBlock* block;
  int place;
};

constexpr FixedColour kUncoloured{128U << 8U, 128U << 8U, 128U << 8U};

void MakeVertices(const Index3& index, const TsdfBlock& block,
                  const std::array<const TsdfBlock*, 8>& around, float voxel, BlockVertices& out) {
  for (int place = 0; place < kBlockVoxels; ++place) {
    if (!Bit(block.observed, place)) continue;
    const Index3 v = VoxelAt(index, place);
    for (int axis = 0; axis < 3; ++axis) {
      const int at = (place >> (3 * axis)) & 7;
      Cell other{};
      if (at < 7) {
        other = {&block, place + (1 << (3 * axis))};
      } else {
        other = {around[static_cast<std::size_t>(1 << axis)], place - (7 << (3 * axis))};
      }
      if (other.block == nullptr || !Bit(other.block->observed, other.place)) continue;
      if (Bit(block.negative, place) == Bit(other.block->negative, other.place)) continue;
      const auto i = static_cast<std::size_t>(place);
      const auto j = static_cast<std::size_t>(other.place);
      const float d0 = block.distance[i];
      const float d1 = other.block->distance[j];
      const float t = d0 / (d0 - d1);
      Eigen::Vector3f position(static_cast<float>(v.x), static_cast<float>(v.y),
                               static_cast<float>(v.z));
      position[axis] += t;
      const bool coloured0 = block.colour_count[i] > 0;
      const bool coloured1 = other.block->colour_count[j] > 0;
      const FixedColour c0 = coloured0 ? block.FixedColourAt(i)
                                       : (coloured1 ? other.block->FixedColourAt(j) : kUncoloured);
      const FixedColour c1 = coloured1 ? other.block->FixedColourAt(j) : c0;
      Colour colour{};
      for (std::size_t c = 0; c < 3; ++c) {
        colour[c] = TsdfBlock::Level(static_cast<std::uint16_t>(
            static_cast<float>(c0[c]) * (1 - t) + static_cast<float>(c1[c]) * t));
      }
      if (out.of_edge.empty()) out.of_edge.assign(3 * kBlockVoxels, kNoVertex);
      out.of_edge[3 * i + static_cast<std::size_t>(axis)] =
          static_cast<std::int32_t>(out.positions.size());
      out.positions.push_back(position * voxel);
      out.colours.push_back(colour);
    }
  }
}

void MakeTriangles(const TsdfBlock& block, const std::array<const TsdfBlock*, 8>& around,
                   const std::array<const BlockVertices*, 8>& vertices, BlockVertices& out) {
  for (int place = 0; place < kBlockVoxels; ++place) {
    if (!Bit(block.observed, place)) continue;
    const int x = place & 7;
    const int y = (place >> 3) & 7;
    const int z = place >> 6;
    unsigned inside = 0;
    bool observed = true;
    std::array<std::size_t, 8> corner_block{};
    std::array<int, 8> corner_place{};
    for (int corner = 0; corner < 8 && observed; ++corner) {
      const int cx = x + (corner & 1);
      const int cy = y + ((corner >> 1) & 1);
      const int cz = z + (corner >> 2);
      const auto which = static_cast<std::size_t>((cx >> 3) | (cy >> 3) << 1 | (cz >> 3) << 2);
      const int at = (cz & 7) * 64 + (cy & 7) * 8 + (cx & 7);
      const TsdfBlock* of = around[which];
      observed = of != nullptr && Bit(of->observed, at);
      if (!observed) break;
      if (Bit(of->negative, at)) inside |= 1U << static_cast<unsigned>(corner);
      corner_block[static_cast<std::size_t>(corner)] = which;
      corner_place[static_cast<std::size_t>(corner)] = at;
    }
    if (!observed || inside == 0 || inside == 255) continue;
    for (const auto& triangle : CubeTriangles(inside)) {
      std::array<std::uint32_t, 3> corners{};
      for (std::size_t i = 0; i < 3; ++i) {
        const std::size_t corner = triangle[i] / 3U;
        const std::size_t axis = triangle[i] % 3U;
        const BlockVertices& of = *vertices[corner_block[corner]];
        const std::int32_t local =
            of.of_edge[3 * static_cast<std::size_t>(corner_place[corner]) + axis];
        corners[i] = of.offset + static_cast<std::uint32_t>(local);
      }
      out.triangles.push_back(corners);
    }
  }
}

// The block and those one further along x, y, z: bit x, y, z of the place in the array.
std::array<const TsdfBlock*, 8> BlocksAround(const TsdfGrid& grid, const Index3& index) {
  std::array<const TsdfBlock*, 8> around{};
  for (int i = 0; i < 8; ++i) {
    around[static_cast<std::size_t>(i)] = grid.Find(index + Index3{i & 1, (i >> 1) & 1, i >> 2});
  }
  return around;
}

// Drops vertices that no triangle names, keeping the order.
TriangleMesh Compact(const std::vector<BlockVertices>& parts, std::size_t vertex_count) {
  std::vector<std::uint32_t> renamed(vertex_count, 0);
  TriangleMesh mesh;
  std::size_t triangle_count = 0;
  for (const BlockVertices& part : parts) {
    triangle_count += part.triangles.size();
    for (const auto& triangle : part.triangles) {
      for (const std::uint32_t v : triangle) renamed[v] = 1;
    }
  }
  std::uint32_t kept = 0;
  for (const BlockVertices& part : parts) {
    for (std::size_t i = 0; i < part.positions.size(); ++i) {
      std::uint32_t& name = renamed[part.offset + i];
      if (name == 0) continue;
      name = kept++;
      mesh.vertices.push_back(part.positions[i]);
      mesh.colours.push_back(part.colours[i]);
    }
  }
  mesh.triangles.reserve(triangle_count);
  for (const BlockVertices& part : parts) {
    for (const auto& t : part.triangles) {
      mesh.triangles.push_back({renamed[t[0]], renamed[t[1]], renamed[t[2]]});
    }
  }
  return mesh;
}

template <typename Function>
void ForEachBlock(std::size_t count, const Function& function) {
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, count, kBlocksPerTask),
      [&](const tbb::blocked_range<std::size_t>& range) {
        for (std::size_t i = range.begin(); i != range.end(); ++i) function(i);
      },
      tbb::simple_partitioner());
}

}  // namespace

const std::vector<std::array<CubeEdge, 3>>& CubeTriangles(unsigned inside_corners) {
  return CubeTable()[inside_corners];
}

TriangleMesh ExtractMesh(const TsdfGrid& grid, float voxel) {
  const std::vector<const TsdfGrid::Entry*> blocks = grid.Sorted();
  std::vector<BlockVertices> parts(blocks.size());
  BlockGrid<std::size_t> part_of;
  for (std::size_t i = 0; i < blocks.size(); ++i) part_of.FindOrAdd(blocks[i]->index) = i;

  ForEachBlock(blocks.size(), [&](std::size_t i) {
    MakeVertices(blocks[i]->index, *blocks[i]->block, BlocksAround(grid, blocks[i]->index), voxel,
                 parts[i]);
  });
  std::uint32_t vertex_count = 0;
  for (BlockVertices& part : parts) {
    part.offset = vertex_count;
    vertex_count += static_cast<std::uint32_t>(part.positions.size());
  }
  ForEachBlock(blocks.size(), [&](std::size_t i) {
    std::array<const BlockVertices*, 8> vertices{};
    bool any = false;
    for (int k = 0; k < 8; ++k) {
      const std::size_t* part =
          part_of.Find(blocks[i]->index + Index3{k & 1, (k >> 1) & 1, k >> 2});
      vertices[static_cast<std::size_t>(k)] = part == nullptr ? nullptr : &parts[*part];
      any = any || (part != nullptr && !parts[*part].positions.empty());
    }
    if (!any) return;
    MakeTriangles(*blocks[i]->block, BlocksAround(grid, blocks[i]->index), vertices, parts[i]);
  });
  return Compact(parts, vertex_count);
}

}  // namespace tsdfpp
