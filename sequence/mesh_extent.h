// How large a mesh is, as BOP's models_info.json says it.
#pragma once

#include "core/types.h"

namespace tsdfpp {

struct MeshExtent {
  Eigen::Vector3d min = Eigen::Vector3d::Zero();
  Eigen::Vector3d max = Eigen::Vector3d::Zero();
  double diameter = 0;  // the greatest distance between two vertices
};

// In the mesh's own unit. Zeros where it has no vertices.
MeshExtent ExtentOf(const TriangleMesh& mesh);

}  // namespace tsdfpp
