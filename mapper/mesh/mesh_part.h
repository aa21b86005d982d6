// What one block contributes to the mesh of its grid, worked out with the blocks' bit masks
// (docs/map.md, "Marching cubes").
#pragma once

#include <array>
#include <vector>

#include "mapper/volume/block_set.h"
#include "mapper/volume/tsdf_block.h"

namespace tsdfpp {

// A part owns the cubes named by its block's voxels, and the vertices on the edges that start at
// them; the triangles of its cubes also name vertices of the seven blocks further along x, y, z.
// Masks are read from parts and not from blocks, because they are small and lie together.
struct MeshPart {
  // What is asked of many parts comes first, so that it is read at once.
  Index3 index;
  bool any_negative = false;
  bool is_settled = true;    // what the scene adds belongs to triangles and values as they are
  bool is_pending = false;   // somebody who follows the scene has not been told how it is now
  bool is_shown = false;     // somebody who follows the scene has triangles of it
  std::uint64_t others = 0;  // IdBit of the objects whose values say which triangles are hidden
  BlockBox looked_up;        // global: at least the blocks that say it
  std::uint32_t todo = 0;    // the cache's own notes
  const TsdfBlock* block = nullptr;

  BlockMask observed{};  // the block's
  BlockMask negative{};
  BlockMask complete{};  // cubes whose eight corners are observed
  BlockMask crossed{};   // complete cubes that the surface passes

  std::array<BlockMask, 3> edges{};                     // by axis: those with a vertex
  std::array<std::uint16_t, 64> row_start{};            // vertices before the row 8 z + y of voxels
  std::uint16_t vertex_count = 0;                       // on all edges
  std::vector<Eigen::Vector3f> positions;               // metres, in the lattice's frame
  std::vector<Colour> colours;                          // of the vertices
  std::vector<std::array<std::uint16_t, 3>> triangles;  // NearVertex each

  // Bit x, y, z of the place: the part one further along x, y, z; nullptr where there is none.
  // Offsets run from -1 to 1: (x + 1) + 3 (y + 1) + 9 (z + 1).
  std::array<MeshPart*, 27> around{};

  // What the scene adds (mapper/mesh/scene_parts.h).
  std::vector<Eigen::Vector3f> placed;  // in the world; empty where the lattice is the world's
  std::vector<InstanceId> face_ids;     // labels of the triangles, of one field
  std::vector<std::uint8_t> hidden;     // 1 for triangles that are not visible; empty where all are
  std::vector<std::uint16_t> renamed;   // of vertices, among the visible; empty where all are
  std::size_t visible_vertices = 0;     // where `renamed` is not empty
  std::uint32_t first_vertex = 0;       // in the mesh that is being put together

  const std::vector<Eigen::Vector3f>& PositionsInWorld() const {
    return placed.empty() ? positions : placed;
  }
};

// One of 64 bits for each object, some of which share one.
inline std::uint64_t IdBit(InstanceId id) { return 1ULL << (id & 63U); }

// A triangle's corner: vertex `local` of the part at offset bit x, y, z of `which`.
inline constexpr unsigned kLocalVertexBits = 11;  // three edges a voxel: 1536
inline constexpr std::uint16_t kLocalVertexMask = (1U << kLocalVertexBits) - 1;
inline std::uint16_t NearVertex(std::size_t which, std::size_t local) {
  return static_cast<std::uint16_t>(which << kLocalVertexBits | local);
}

inline std::size_t AroundPlace(int x, int y, int z) {
  return static_cast<std::size_t>((x + 1) + 3 * (y + 1) + 9 * (z + 1));
}
// The place in `around` of the part at offset bit x, y, z of `which`.
inline std::size_t UpperPlace(std::size_t which) {
  return AroundPlace(which & 1U, (which >> 1U) & 1U, which >> 2U);
}
// The same in the other direction.
inline std::size_t LowerPlace(std::size_t which) { return 26 - UpperPlace(which); }

// In MeshPart::renamed, of a vertex that no visible triangle names: more than any vertex of a part.
inline constexpr std::uint16_t kNotShown = 0xFFFF;

// Brings `complete` and `crossed` in line with the masks of the part and of the seven upper ones.
// True where `complete` changed.
bool FindCubes(MeshPart& part);
// Brings `edges` and `row_start` in line with the cubes around; true where they changed.
bool FindEdges(MeshPart& part);
// Vertices of the edges, from the values of the block and of the next one along each axis.
void MakeVertices(MeshPart& part, float voxel);
// Triangles of the crossed cubes, from masks and edges of the part and of the seven upper ones.
void MakeTriangles(MeshPart& part);

}  // namespace tsdfpp
