#include "mapper/mesh/mesh_part.h"

#include <algorithm>
#include <bit>

#include "mapper/mesh/marching_cubes.h"
#include "mapper/volume/cube_masks.h"

namespace tsdfpp {
namespace {

constexpr FixedColour kUncoloured{128U << 8U, 128U << 8U, 128U << 8U};

std::size_t At(int i) { return static_cast<std::size_t>(i); }

// Slices moved by one voxel down; `last` is the same slice of the neighbouring block.
std::uint64_t AtLastX(std::uint64_t slice, std::uint64_t last) {
  return ((slice << 1U) & ~kFirstColumn) | ((last >> 7U) & kFirstColumn);
}
std::uint64_t AtLastY(std::uint64_t slice, std::uint64_t last) {
  return (slice << 8U) | (last >> 56U);
}

// One mask of a part and of the seven upper ones.
UpperMasks UpperMasksOf(const MeshPart& part, BlockMask MeshPart::*mask) {
  UpperMasks masks{};
  for (std::size_t i = 0; i < 8; ++i) {
    const MeshPart* of = part.around[UpperPlace(i)];
    masks[i] = of == nullptr ? &kNoVoxels : &(of->*mask);
  }
  return masks;
}

constexpr auto kBitCounts = [] {
  std::array<std::uint8_t, 256> counts{};
  for (unsigned i = 0; i < counts.size(); ++i) {
    counts[i] = static_cast<std::uint8_t>(std::popcount(i));
  }
  return counts;
}();

// The bits of each byte counted, all eight at once.
std::uint64_t CountInBytes(std::uint64_t bits) {
  bits -= (bits >> 1U) & 0x5555555555555555ULL;
  bits = (bits & 0x3333333333333333ULL) + ((bits >> 2U) & 0x3333333333333333ULL);
  return (bits + (bits >> 4U)) & 0x0F0F0F0F0F0F0F0FULL;
}

// The number of the vertex on the edge (x, y, z, axis) in the part.
inline unsigned NumberOf(const MeshPart& part, unsigned x, unsigned y, unsigned z, unsigned axis) {
  const auto row_of = [&](std::size_t a) {
    return static_cast<unsigned>(part.edges[a][z] >> (8 * y)) & 0xFFU;
  };
  const std::array<unsigned, 3> row{row_of(0), row_of(1), row_of(2)};
  const unsigned below = (1U << x) - 1;
  unsigned number = part.row_start[8 * z + y] + kBitCounts[row[0] & below] +
                    kBitCounts[row[1] & below] + kBitCounts[row[2] & below];
  if (axis > 0) number += (row[0] >> x) & 1U;
  if (axis > 1) number += (row[1] >> x) & 1U;
  return number;
}

// The table of marching cubes in one piece: at most five triangles a cube.
struct FlatTriangles {
  std::uint8_t count = 0;
  std::array<CubeEdge, 15> corners{};
};
const std::array<FlatTriangles, 256>& FlatTable() {
  static const std::array<FlatTriangles, 256> table = [] {
    std::array<FlatTriangles, 256> made{};
    for (unsigned inside = 0; inside < made.size(); ++inside) {
      for (const auto& triangle : CubeTriangles(inside)) {
        for (const CubeEdge edge : triangle) {
          made[inside].corners[made[inside].count++] = edge;
        }
      }
    }
    return made;
  }();
  return table;
}

}  // namespace

bool FindCubes(MeshPart& part) {
  const auto [complete, crossed] = FindCubeMasks(UpperMasksOf(part, &MeshPart::observed),
                                                 UpperMasksOf(part, &MeshPart::negative));
  const bool changed = complete != part.complete;
  part.complete = complete;
  part.crossed = crossed;
  return changed;
}

bool FindEdges(MeshPart& part) {
  const auto mask_at = [&](int x, int y, int z, BlockMask MeshPart::*mask) {
    const MeshPart* of = part.around[AroundPlace(x, y, z)];
    return of == nullptr ? &kNoVoxels : &(of->*mask);
  };
  const auto complete_at = [&](int x, int y, int z) {
    return mask_at(x, y, z, &MeshPart::complete);
  };
  const BlockMask& c = part.complete;
  const BlockMask& c_x = *complete_at(-1, 0, 0);
  const BlockMask& c_y = *complete_at(0, -1, 0);
  const BlockMask& c_z = *complete_at(0, 0, -1);
  const BlockMask& c_xy = *complete_at(-1, -1, 0);
  const BlockMask& c_xz = *complete_at(-1, 0, -1);
  const BlockMask& c_yz = *complete_at(0, -1, -1);
  const BlockMask& negative = part.negative;
  const BlockMask& next_x = *mask_at(1, 0, 0, &MeshPart::negative);
  const BlockMask& next_y = *mask_at(0, 1, 0, &MeshPart::negative);
  const BlockMask& next_z = *mask_at(0, 0, 1, &MeshPart::negative);
  std::array<BlockMask, 3> edges{};
  // An edge has a vertex where its ends differ and one of the four cubes around it is complete.
  std::uint64_t below_by_y = c_z[7] | AtLastY(c_z[7], c_yz[7]);
  std::uint64_t below_by_x = c_z[7] | AtLastX(c_z[7], c_xz[7]);
  for (std::size_t z = 0; z < kBlockSide; ++z) {
    const std::uint64_t by_y = c[z] | AtLastY(c[z], c_y[z]);
    const std::uint64_t by_x = c[z] | AtLastX(c[z], c_x[z]);
    const std::uint64_t by_xy = by_y | AtLastX(by_y, c_x[z] | AtLastY(c_x[z], c_xy[z]));
    const std::uint64_t n = negative[z];
    edges[0][z] = (n ^ AtNextX(n, next_x[z])) & (by_y | below_by_y);
    edges[1][z] = (n ^ AtNextY(n, next_y[z])) & (by_x | below_by_x);
    edges[2][z] = (n ^ (z + 1 < kBlockSide ? negative[z + 1] : next_z[0])) & by_xy;
    below_by_y = by_y;
    below_by_x = by_x;
  }
  if (edges == part.edges) return false;
  part.edges = edges;
  unsigned count = 0;
  for (std::size_t z = 0; z < kBlockSide; ++z) {
    const std::uint64_t rows =
        CountInBytes(edges[0][z]) + CountInBytes(edges[1][z]) + CountInBytes(edges[2][z]);
    const std::uint64_t up_to = rows * kFirstColumn;  // at most 192 in a slice: no byte overflows
    for (std::size_t y = 0; y < kBlockSide; ++y) {
      part.row_start[8 * z + y] =
          static_cast<std::uint16_t>(count + (y == 0 ? 0 : (up_to >> (8 * (y - 1))) & 0xFFU));
    }
    count += static_cast<unsigned>(up_to >> 56U);
  }
  part.vertex_count = static_cast<std::uint16_t>(count);
  return true;
}

void MakeVertices(MeshPart& part, float voxel) {
  // Exactly as large as needed, because what is kept stays.
  if (part.positions.size() != part.vertex_count) {
    part.positions = std::vector<Eigen::Vector3f>(part.vertex_count);
    part.colours = std::vector<Colour>(part.vertex_count);
  }
  if (part.vertex_count == 0) return;
  std::size_t number = 0;
  const TsdfBlock& block = *part.block;
  for (int z = 0; z < kBlockSide; ++z) {
    const std::array<std::uint64_t, 3> edges{part.edges[0][At(z)], part.edges[1][At(z)],
                                             part.edges[2][At(z)]};
    for (std::uint64_t bits = edges[0] | edges[1] | edges[2]; bits != 0; bits &= bits - 1) {
      const int bit = std::countr_zero(bits);
      const int place = 64 * z + bit;
      const Index3 v = VoxelAt(part.index, place);
      const std::size_t i = At(place);
      const float d0 = block.distance[i];
      const bool coloured0 = block.ColourCount(i) > 0;
      for (int axis = 0; axis < 3; ++axis) {
        if (((edges[At(axis)] >> static_cast<unsigned>(bit)) & 1U) == 0) continue;
        const bool inner = ((place >> (3 * axis)) & 7) < 7;
        const TsdfBlock& other =
            inner ? block : *part.around[UpperPlace(std::size_t{1} << At(axis))]->block;
        const std::size_t j = At(inner ? place + (1 << (3 * axis)) : place - (7 << (3 * axis)));
        const float t = d0 / (d0 - other.distance[j]);
        Eigen::Vector3f position(static_cast<float>(v.x), static_cast<float>(v.y),
                                 static_cast<float>(v.z));
        position[axis] += t;
        const bool coloured1 = other.ColourCount(j) > 0;
        const FixedColour c0 =
            coloured0 ? block.FixedColourAt(i) : (coloured1 ? other.FixedColourAt(j) : kUncoloured);
        const FixedColour c1 = coloured1 ? other.FixedColourAt(j) : c0;
        Colour colour{};
        for (std::size_t c = 0; c < 3; ++c) {
          colour[c] = TsdfBlock::Level(static_cast<std::uint16_t>(
              static_cast<float>(c0[c]) * (1 - t) + static_cast<float>(c1[c]) * t));
        }
        part.positions[number] = position * voxel;
        part.colours[number++] = colour;
      }
    }
  }
}

void MakeTriangles(MeshPart& part) {
  thread_local std::vector<std::array<std::uint16_t, 3>> made;
  made.clear();
  const UpperMasks negative = UpperMasksOf(part, &MeshPart::negative);
  const auto& table = FlatTable();
  for (unsigned z = 0; z < kBlockSide; ++z) {
    if (part.crossed[z] == 0) continue;
    std::array<std::uint64_t, 8> corner{};  // the slice of each of a cube's corners
    for (std::size_t up = 0; up < 2; ++up) {
      const std::uint64_t here = SliceOf(negative, 0, z + up);
      const std::uint64_t next_y = SliceOf(negative, 2, z + up);
      corner[4 * up] = here;
      corner[4 * up + 1] = AtNextX(here, SliceOf(negative, 1, z + up));
      corner[4 * up + 2] = AtNextY(here, next_y);
      corner[4 * up + 3] =
          AtNextY(corner[4 * up + 1], AtNextX(next_y, SliceOf(negative, 3, z + up)));
    }
    for (std::uint64_t bits = part.crossed[z]; bits != 0; bits &= bits - 1) {
      const auto place = static_cast<unsigned>(std::countr_zero(bits));
      const unsigned x = place & 7U;
      const unsigned y = place >> 3U;
      unsigned inside = 0;
      for (unsigned i = 0; i < 8; ++i) {
        inside |= static_cast<unsigned>((corner[i] >> place) & 1U) << i;
      }
      const FlatTriangles& triangles = table[inside];
      std::array<std::uint16_t, 24> vertex;  // of each edge that is cut
      std::uint32_t known = 0;
      const auto vertex_of = [&](CubeEdge edge) {
        if (((known >> edge) & 1U) == 0) {
          known |= 1U << edge;
          const unsigned from = edge / 3U;
          const unsigned ex = x + (from & 1U);
          const unsigned ey = y + ((from >> 1U) & 1U);
          const unsigned ez = z + (from >> 2U);
          const std::size_t which = (ex >> 3U) | (ey >> 3U) << 1U | (ez >> 3U) << 2U;
          vertex[edge] = NearVertex(which, NumberOf(*part.around[UpperPlace(which)], ex & 7U,
                                                    ey & 7U, ez & 7U, edge % 3U));
        }
        return vertex[edge];
      };
      for (std::size_t i = 0; i < triangles.count; i += 3) {
        const std::uint16_t a = vertex_of(triangles.corners[i]);
        const std::uint16_t b = vertex_of(triangles.corners[i + 1]);
        const std::uint16_t c = vertex_of(triangles.corners[i + 2]);
        made.push_back({a, b, c});
      }
    }
  }
  if (part.triangles.size() == made.size()) {
    std::copy(made.begin(), made.end(), part.triangles.begin());
  } else {
    part.triangles = std::vector<std::array<std::uint16_t, 3>>(made.begin(), made.end());
  }
}

}  // namespace tsdfpp
