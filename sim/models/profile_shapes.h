// More generators of closed, outward triangle meshes: solids whose outline is not convex. Metres.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

#include "sim/models/mesh_shapes.h"

namespace tsdfpp {

// MakeExtrusion for any polygon (x, z) that does not cross itself, counter-clockwise seen from -y.
// `bevel` is to be smaller than half of the narrowest place.
Shape MakePrism(const std::vector<Eigen::Vector2d>& polygon_xz, double half_width, double bevel);

// A tube of radius `radius` along a closed path that does not meet itself.
Shape MakeRing(const std::vector<Eigen::Vector3d>& path, double radius, int segments);

// A rounded rectangle around the z axis, one ring for MakeLoft.
std::vector<Eigen::Vector3d> RectangleRing(double half_x, double half_y, double radius, double z);

// A slab with rounded rims lying flat, z = low to high.
Shape MakeSlab(double half_x, double half_y, double corner, double low, double high, double bevel);

// A rectangular vessel, open above, z = 0 to height: walls and bottom are `wall` thick, the rim is
// rounded; walls lean outwards so that the top is `flare` wider on each side than the bottom.
Shape MakeVessel(double half_x, double half_y, double corner, double height, double wall,
                 double flare);

// The same as a body of revolution, outer radii given; `wall` thick.
Shape MakeCup(double bottom_radius, double top_radius, double height, double wall, int segments);

}  // namespace tsdfpp
