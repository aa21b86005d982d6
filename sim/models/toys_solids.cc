#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <numbers>

#include "sim/models/profile_shapes.h"
#include "sim/models/toys.h"

namespace tsdfpp {
namespace {

constexpr int kSolidSegments = 48;  // of a turned shape
constexpr double kMostBevel_m = 0.004;

double Bevel(const Eigen::Vector3d& size) { return std::min(kMostBevel_m, 0.12 * size.minCoeff()); }

Shape Block(const Eigen::Vector3d& size) {
  const double bevel = Bevel(size);
  return MakeSlab(size.x() / 2, size.y() / 2, bevel * 1.5, 0, size.z(), bevel);
}

// A turned profile of extent size.x() across, squeezed to size.y() along y.
Shape Turned(const std::vector<Eigen::Vector2d>& profile, const Eigen::Vector3d& size) {
  Shape shape = MakeLathe(profile, kSolidSegments);
  for (Eigen::Vector3d& vertex : shape.vertices) vertex.y() *= size.y() / size.x();
  return shape;
}

Shape Cylinder(const Eigen::Vector3d& size) {
  return Turned(CylinderProfile(size.x() / 2, 0, size.z(), Bevel(size)), size);
}

Shape Sphere(const Eigen::Vector3d& size) {
  Shape shape = MakeLathe(BallProfile(0.5, 0.5), kSolidSegments);
  for (Eigen::Vector3d& vertex : shape.vertices) vertex = vertex.cwiseProduct(size);
  return shape;
}

Shape Cone(const Eigen::Vector3d& size) {
  const double radius = size.x() / 2;
  const double bevel = Bevel(size);
  std::vector<Eigen::Vector2d> profile{{0, 0}, {radius - bevel, 0}, {radius, 0.6 * bevel}};
  // Rings up the side, so that light on it is smooth; the tip is blunt.
  constexpr int kSteps = 6;
  const double tip = 0.04 * radius;
  for (int i = 1; i <= kSteps; ++i) {
    const double t = static_cast<double>(i) / kSteps;
    profile.emplace_back(radius + t * (tip - radius), 0.6 * bevel + t * (size.z() - 1.2 * bevel));
  }
  profile.emplace_back(0, size.z());
  return Turned(profile, size);
}

Shape Capsule(const Eigen::Vector3d& size) {
  constexpr int kSteps = 12;  // of each round end
  const double radius = size.x() / 2;
  const double end = std::min(radius, size.z() / 2);  // height of a round end
  std::vector<Eigen::Vector2d> profile;
  for (const bool top : {false, true}) {
    // Where the ends meet in the middle there is one ring between them, not two.
    const bool meet = top && end * 2 >= size.z();
    for (int i = meet ? 1 : 0; i <= kSteps; ++i) {
      const double angle = std::numbers::pi / 2 * (static_cast<double>(i) / kSteps - (top ? 0 : 1));
      profile.emplace_back(radius * std::cos(angle),
                           (top ? size.z() - end : end) + end * std::sin(angle));
    }
  }
  profile.front().x() = 0;
  profile.back().x() = 0;
  return Turned(profile, size);
}

Shape Pyramid(const Eigen::Vector3d& size) {
  const double blunt = 0.05;  // share of the base that is left at the top
  const double bevel = Bevel(size);
  std::vector<std::vector<Eigen::Vector3d>> rings;
  const auto add = [&](double share, double inset, double z) {
    rings.push_back(RectangleRing(share * size.x() / 2 - inset, share * size.y() / 2 - inset,
                                  share * 2 * bevel, z));
  };
  add(1, 0.6 * bevel, 0);
  add(1, 0, 0.6 * bevel);
  add(0.5 + blunt / 2, 0, (0.6 * bevel + size.z()) / 2);
  add(blunt, 0, size.z());
  return MakeLoft(rings);
}

// Rises towards +x.
Shape Wedge(const Eigen::Vector3d& size) {
  const double half = size.x() / 2;
  const double toe = 0.12 * size.z();
  return MakePrism(
      {{-half, 0}, {half, 0}, {half, size.z()}, {half - 0.06 * size.x(), size.z()}, {-half, toe}},
      size.y() / 2, 0.5 * std::min(Bevel(size), toe));
}

Shape Hexagon(const Eigen::Vector3d& size) {
  const double bevel = Bevel(size);
  std::vector<std::vector<Eigen::Vector3d>> rings;
  const auto add = [&](double inset, double z) {
    std::vector<Eigen::Vector3d> ring;
    for (int i = 0; i < 6; ++i) {
      const double angle = std::numbers::pi / 3 * i;
      ring.emplace_back((size.x() / 2 - inset) * std::cos(angle),
                        (size.y() / 2 - inset) * std::sin(angle) / std::sin(std::numbers::pi / 3),
                        z);
    }
    rings.push_back(ring);
  };
  add(bevel, 0);
  add(0.3 * bevel, 0.3 * bevel);
  add(0, bevel);
  add(0, size.z() - bevel);
  add(0.3 * bevel, size.z() - 0.3 * bevel);
  add(bevel, size.z());
  return MakeLoft(rings);
}

struct Solid {
  std::string_view name;
  Shape (*make)(const Eigen::Vector3d&);
  Colour colour;
};

constexpr std::array<Solid, 11> kSolids{{{"cube", Block, {204, 62, 54}},
                                         {"brick", Block, {64, 122, 186}},
                                         {"domino", Block, {236, 230, 214}},
                                         {"plank", Block, {196, 148, 92}},
                                         {"cylinder", Cylinder, {242, 178, 52}},
                                         {"sphere", Sphere, {222, 96, 46}},
                                         {"cone", Cone, {76, 154, 88}},
                                         {"capsule", Capsule, {142, 92, 168}},
                                         {"pyramid", Pyramid, {224, 190, 112}},
                                         {"wedge", Wedge, {86, 160, 170}},
                                         {"hexagon", Hexagon, {206, 104, 140}}}};

}  // namespace

const std::vector<std::string_view>& SolidNames() {
  static const std::vector<std::string_view> names = [] {
    std::vector<std::string_view> all;
    for (const Solid& solid : kSolids) all.push_back(solid.name);
    return all;
  }();
  return names;
}

std::vector<ModelPart> MakeSolid(std::string_view kind, const Eigen::Vector3d& size_m) {
  for (const Solid& solid : kSolids) {
    if (solid.name == kind) {
      return {{std::string(kind), solid.make(size_m), solid.colour, "", ""}};
    }
  }
  std::abort();  // the catalogue names the solids above only
}

}  // namespace tsdfpp
