// Meshes as small as a page can carry them: cut by layer, decimated, quantised, encoded with
// meshoptimizer (docs/report.md).
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "core/types.h"

namespace tsdfpp {

// Sixteen bits an axis: p_W = origin + step_m * n, for n in [0, 65535].
struct PositionGrid {
  Eigen::Vector3f origin = Eigen::Vector3f::Zero();
  float step_m = 1e-4F;
};

// A grid that holds `box` and a metre around it.
PositionGrid GridAround(const Eigen::AlignedBox3f& box);

// Whether all of the box is on the grid.
bool Holds(const PositionGrid& grid, const Eigen::AlignedBox3f& box);

// What a page shows of a vertex besides its place and colour, in its own steps.
struct VertexMeasures {
  std::vector<std::uint8_t> error;
  std::vector<std::uint8_t> age;
};

struct PackedMesh {
  std::size_t vertices = 0;
  std::size_t triangles = 0;
  std::string vertex_bytes;  // meshopt_encodeVertexBuffer of PackedVertex
  std::string index_bytes;   // meshopt_encodeIndexBuffer
};

// The layout of a vertex, 12 bytes, little-endian.
struct PackedVertex {
  std::uint16_t position[3];  // on the PositionGrid
  std::uint8_t error;
  std::uint8_t age;
  std::uint8_t colour[3];
  std::uint8_t zero = 0;
};
static_assert(sizeof(PackedVertex) == 12);

// The two scenes of a removal cut into what both have, what only the scene with the moving objects
// has (without their own faces), and what only the removal shows. Triangles are the same where all
// coordinates and the label are.
struct RemovalLayers {
  TriangleMesh common;
  TriangleMesh gone;
  TriangleMesh revealed;
};
RemovalLayers CutByRemoval(const TriangleMesh& scene_W, const TriangleMesh& revealed_W,
                           const std::vector<InstanceId>& movers);

// The mesh with vertices at the same place joined and at most about `triangles` triangles, by
// quadric error (meshopt_simplify). Borders stay as they are, so parts that were cut from each
// other still meet; a mesh of many borders can keep more triangles.
TriangleMesh Decimate(const TriangleMesh& mesh, std::size_t triangles);

// `measures` has an entry a vertex, or is empty. Positions outside of the grid go to its faces.
PackedMesh Pack(const TriangleMesh& mesh, const VertexMeasures& measures, const PositionGrid& grid);

// Whether these bytes are such a mesh, of so many vertices and triangles.
bool IsPackedMesh(std::string_view vertex_bytes, std::size_t vertices, std::string_view index_bytes,
                  std::size_t triangles);

}  // namespace tsdfpp
