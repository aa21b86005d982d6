// Small operations on triangle meshes that the metrics share.
#pragma once

#include <Eigen/Geometry>
#include <set>

#include "core/types.h"

namespace tsdfpp {

// Corner `corner` (0, 1, 2) of a triangle.
inline const Eigen::Vector3f& Corner(const TriangleMesh& mesh, std::size_t triangle, int corner) {
  return mesh.vertices[mesh.triangles[triangle][static_cast<std::size_t>(corner)]];
}

// Half the cross product of two edges: its length is the area in m^2, its direction the outward
// normal of a triangle that is counter-clockwise seen from outside.
Eigen::Vector3d AreaVector(const TriangleMesh& mesh, std::size_t triangle);

// Sum of the triangles' areas, m^2.
double SurfaceArea(const TriangleMesh& mesh);

// The faces labelled `id`, with the vertices they use. A mesh without labels gives an empty mesh.
TriangleMesh FacesOf(const TriangleMesh& mesh, InstanceId id);

// The faces labelled with none of `ids`, with the vertices they use.
TriangleMesh FacesWithout(const TriangleMesh& mesh, const std::set<InstanceId>& ids);

// The faces whose bounding boxes meet `box`, with the vertices they use and their labels. Leaving
// out what is farther than a limit from the queried samples keeps an index small; a distance below
// that limit is unchanged by it.
TriangleMesh FacesNear(const TriangleMesh& mesh, const Eigen::AlignedBox3f& box);

// The box of the vertices; empty where there are none.
Eigen::AlignedBox3f BoundsOf(const TriangleMesh& mesh);

// Shortest distance between a point and the closed triangle (a, b, c), metres. Exact; degenerate
// triangles count as the segment or point that they are.
float PointTriangleDistance(const Eigen::Vector3f& point, const Eigen::Vector3f& a,
                            const Eigen::Vector3f& b, const Eigen::Vector3f& c);

}  // namespace tsdfpp
