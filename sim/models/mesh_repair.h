// Makes a raw mesh fit to be rendered: welded, cleaned, faces turned to agree.
#pragma once

#include <cstdint>
#include <vector>

#include "sim/models/mesh_files.h"
#include "sim/models/mesh_shapes.h"

namespace tsdfpp {

struct RepairedMesh {
  Shape shape;                        // vertices at one place are one, all of them used
  std::vector<std::uint32_t> source;  // the raw triangle of each triangle
  std::vector<bool> is_turned;        // its second and third corner have changed places
  std::size_t degenerate = 0;
  std::size_t duplicate = 0;
  std::size_t turned = 0;
  std::size_t open_edges = 0;  // not shared by exactly two triangles that agree
};

// Welds vertices whose coordinates are equal to the bit; drops triangles without an area (an edge
// that only such a one closes counts as closed) and those that are there twice; turns faces over
// where neighbours disagree (a closed piece outwards, an open one as most of its faces are) and
// turns over the whole of a closed mesh whose volume is negative. Pieces that agree keep their
// orientation, so the wall of a cavity does.
RepairedMesh Repair(const std::vector<Eigen::Vector3d>& vertices,
                    const std::vector<RawTriangle>& triangles);

}  // namespace tsdfpp
