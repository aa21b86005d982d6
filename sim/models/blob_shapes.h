// Smooth shapes given by a function: negative inside, positive outside. Metres.
#pragma once

#include <Eigen/Geometry>
#include <functional>
#include <vector>

#include "sim/models/mesh_shapes.h"

namespace tsdfpp {

// About the distance to a surface; it need be exact nowhere but at 0.
using BlobField = std::function<double(const Eigen::Vector3d&)>;

BlobField Ellipsoid(const Eigen::Vector3d& centre, const Eigen::Vector3d& radii);
// A ball of radius `radius_a` at a and one of radius `radius_b` at b, and what a ball that changes
// between them sweeps.
BlobField Limb(const Eigen::Vector3d& a, const Eigen::Vector3d& b, double radius_a,
               double radius_b);
// All of them, joined by fillets of about `fillet`.
BlobField Joined(std::vector<BlobField> fields, double fillet);
// What lies in both, the edge rounded.
BlobField Common(BlobField one, BlobField other, double round);
// Above the plane through `point` that faces away from `normal`.
BlobField Below(const Eigen::Vector3d& point, const Eigen::Vector3d& normal);
// Swollen by `distance`.
BlobField Swollen(BlobField field, double distance);

// The surface where the field is 0, as a closed outward mesh with edges of about `cell`: a surface
// net (a vertex in each grid cell that the surface crosses, moved onto the surface). The surface
// lies within the box; features thinner than two cells are lost.
Shape MakeBlob(const BlobField& field, const Eigen::AlignedBox3d& box, double cell);

}  // namespace tsdfpp
