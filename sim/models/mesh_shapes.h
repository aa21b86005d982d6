// Generators of closed triangle meshes, oriented outwards (counter-clockwise seen from outside).
// Curved toys are always such meshes: MuJoCo draws its own spheres and cylinders as polygons that
// differ from what its rays hit (docs/sources.md, "Curved shapes"). Metres throughout.
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <vector>

namespace tsdfpp {

struct Shape {
  std::vector<Eigen::Vector3d> vertices;
  std::vector<std::array<std::uint32_t, 3>> triangles;
};

// An axis-aligned box; each face is a grid of cells no longer than `cell_m`, because the
// fixed-function renderer lights vertices, not pixels.
Shape MakeBox(const Eigen::Vector3d& low, const Eigen::Vector3d& high, double cell_m);

// A convex polygon (x, z), counter-clockwise seen from -y, swept along y from -half_width to
// +half_width, the rim rounded with radius `bevel`.
Shape MakeExtrusion(const std::vector<Eigen::Vector2d>& polygon_xz, double half_width,
                    double bevel);

// The rectangle low..high with corners rounded by `radius`, as a polygon for MakeExtrusion.
std::vector<Eigen::Vector2d> RoundedRectangle(const Eigen::Vector2d& low,
                                              const Eigen::Vector2d& high, double radius);

// A profile (r, z) turned around the z axis. It starts and ends on the axis (r = 0) and runs so
// that the solid lies to its left: upwards on the outside, e.g. from the bottom's centre to the
// top's.
Shape MakeLathe(const std::vector<Eigen::Vector2d>& profile_rz, int segments);

// The profile of a cylinder from z = low to high with rounded rims, and that of a ball.
std::vector<Eigen::Vector2d> CylinderProfile(double radius, double low, double high, double bevel);
std::vector<Eigen::Vector2d> BallProfile(double radius, double centre_z);

// A half ring in the x-z plane, bulging towards +x: a tube of radius `tube` along a half circle of
// radius `ring` around the origin, its ends capped.
Shape MakeHandle(double ring, double tube);

// Closed rings of equally many vertices, one stacked on the other and joined, both ends closed by
// fans around their middles (so the first and the last are star-shaped from there).
Shape MakeLoft(const std::vector<std::vector<Eigen::Vector3d>>& rings);

Shape Transformed(Shape shape, const Eigen::Isometry3d& T);
Shape Translated(Shape shape, double x, double y, double z);

// The signed volume enclosed (positive when oriented outwards), cubic metres.
double SignedVolume(const Shape& shape);

}  // namespace tsdfpp
