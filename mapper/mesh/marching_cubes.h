// Marching cubes over a sparse grid (docs/map.md, "Marching cubes"; Lorensen and Cline 1987).
#pragma once

#include <array>
#include <vector>

#include "mapper/volume/tsdf_block.h"

namespace tsdfpp {

// A cube's triangles for each of the 256 sets of inside corners (bit x + 2 y + 4 z). An edge is
// 3 * lower corner + axis; triangles are counter-clockwise seen from outside.
using CubeEdge = std::uint8_t;
const std::vector<std::array<CubeEdge, 3>>& CubeTriangles(unsigned inside_corners);

// The surface of all observed cubes; vertices in the lattice's frame, metres, shared between
// triangles, coloured. The order depends on the grid's content alone, not on threads or insertion.
TriangleMesh ExtractMesh(const TsdfGrid& grid, float voxel);

}  // namespace tsdfpp
