#include "sim/models/profile_shapes.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "core/polygon.h"

namespace tsdfpp {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr int kBevelSteps = 3;  // polygon steps of a rounded rim
constexpr int kRimSteps = 6;    // of a vessel's rim, half around

// The polygon moved inwards by `distance`, corners mitred.
std::vector<Eigen::Vector2d> Inset(const std::vector<Eigen::Vector2d>& polygon, double distance) {
  const std::size_t n = polygon.size();
  std::vector<Eigen::Vector2d> inset(n);
  for (std::size_t i = 0; i < n; ++i) {
    const Eigen::Vector2d before = (polygon[i] - polygon[(i + n - 1) % n]).normalized();
    const Eigen::Vector2d after = (polygon[(i + 1) % n] - polygon[i]).normalized();
    const Eigen::Vector2d normal_before(-before.y(), before.x());
    const Eigen::Vector2d normal_after(-after.y(), after.x());
    inset[i] = polygon[i] +
               distance * (normal_before + normal_after) / (1.0 + normal_before.dot(normal_after));
  }
  return inset;
}

}  // namespace

Shape MakePrism(const std::vector<Eigen::Vector2d>& polygon_xz, double half_width, double bevel) {
  const auto n = static_cast<std::uint32_t>(polygon_xz.size());
  std::vector<std::pair<double, double>> rings;  // y and inset
  if (bevel > 0) {
    for (int i = 0; i <= kBevelSteps; ++i) {
      const double angle = kPi / 2 * i / kBevelSteps;
      rings.emplace_back(-half_width + bevel * (1 - std::sin(angle)),
                         bevel * (1 - std::cos(angle)));
    }
    std::reverse(rings.begin(), rings.end());
  } else {
    rings.emplace_back(-half_width, 0);
  }
  for (std::size_t i = rings.size(); i-- > 0;) rings.emplace_back(-rings[i].first, rings[i].second);
  Shape shape;
  for (const auto& [y, inset] : rings) {
    for (const Eigen::Vector2d& p : Inset(polygon_xz, inset)) {
      shape.vertices.emplace_back(p.x(), y, p.y());
    }
  }
  const auto last = static_cast<std::uint32_t>(rings.size() - 1) * n;
  for (std::uint32_t first = 0; first < last; first += n) {
    for (std::uint32_t i = 0; i < n; ++i) {
      const std::uint32_t next = (i + 1) % n;
      // Seen from -y the polygon runs counter-clockwise, so seen from outside it runs to the right.
      shape.triangles.push_back({first + i, first + n + i, first + n + next});
      shape.triangles.push_back({first + i, first + n + next, first + next});
    }
  }
  for (const auto& [a, b, c] : CutPolygon(Inset(polygon_xz, rings.front().second))) {
    shape.triangles.push_back({a, b, c});
    shape.triangles.push_back({last + a, last + c, last + b});
  }
  if (SignedVolume(shape) < 0) {
    for (auto& triangle : shape.triangles) std::swap(triangle[1], triangle[2]);
  }
  return shape;
}

Shape MakeRing(const std::vector<Eigen::Vector3d>& path, double radius, int segments) {
  const std::size_t n = path.size();
  std::vector<Eigen::Vector3d> tangent(n);
  for (std::size_t i = 0; i < n; ++i) {
    tangent[i] = (path[(i + 1) % n] - path[(i + n - 1) % n]).normalized();
  }
  // A normal carried along the path without turning around it ...
  std::vector<Eigen::Vector3d> normal(n + 1);
  normal[0] = tangent[0].unitOrthogonal();
  for (std::size_t i = 1; i <= n; ++i) {
    normal[i] = Eigen::Quaterniond::FromTwoVectors(tangent[i - 1], tangent[i % n]) * normal[i - 1];
  }
  // ... comes back turned; that turn is spread over the way.
  const double turn =
      std::atan2(normal[0].cross(normal[n]).dot(tangent[0]), normal[0].dot(normal[n]));
  Shape shape;
  for (std::size_t i = 0; i < n; ++i) {
    const double back = -turn * static_cast<double>(i) / static_cast<double>(n);
    const Eigen::Vector3d u = Eigen::AngleAxisd(back, tangent[i]) * normal[i];
    const Eigen::Vector3d v = tangent[i].cross(u);
    for (int s = 0; s < segments; ++s) {
      const double angle = 2 * kPi * s / segments;
      shape.vertices.emplace_back(path[i] + radius * (std::cos(angle) * u + std::sin(angle) * v));
    }
  }
  const auto around = static_cast<std::uint32_t>(segments);
  const auto count = static_cast<std::uint32_t>(n);
  for (std::uint32_t i = 0; i < count; ++i) {
    const std::uint32_t here = i * around;
    const std::uint32_t there = (i + 1) % count * around;
    for (std::uint32_t s = 0; s < around; ++s) {
      const std::uint32_t next = (s + 1) % around;
      shape.triangles.push_back({here + s, here + next, there + next});
      shape.triangles.push_back({here + s, there + next, there + s});
    }
  }
  return shape;
}

std::vector<Eigen::Vector3d> RectangleRing(double half_x, double half_y, double radius, double z) {
  std::vector<Eigen::Vector3d> ring;
  for (const Eigen::Vector2d& p : RoundedRectangle({-half_x, -half_y}, {half_x, half_y}, radius)) {
    ring.emplace_back(p.x(), p.y(), z);
  }
  return ring;
}

Shape MakeSlab(double half_x, double half_y, double corner, double low, double high, double bevel) {
  std::vector<std::vector<Eigen::Vector3d>> rings;
  for (const bool top : {false, true}) {
    for (int i = 0; i <= kBevelSteps; ++i) {
      const double angle = kPi / 2 * (static_cast<double>(i) / kBevelSteps - (top ? 0 : 1));
      const double inset = bevel * (1 - std::cos(angle));
      rings.push_back(RectangleRing(half_x - inset, half_y - inset, corner - inset,
                                    (top ? high - bevel : low + bevel) + bevel * std::sin(angle)));
    }
  }
  return MakeLoft(rings);
}

Shape MakeVessel(double half_x, double half_y, double corner, double height, double wall,
                 double flare) {
  std::vector<std::vector<Eigen::Vector3d>> rings;
  // `out` is how far the ring lies outside the bottom's outline.
  const auto add = [&](double out, double z) {
    rings.push_back(RectangleRing(half_x - flare + out, half_y - flare + out,
                                  std::max(corner + out, 0.001), z));
  };
  const double edge = wall / 3;  // roundness of the outer lower edge
  add(-edge, 0);
  add(-0.3 * edge, 0.3 * edge);
  add(flare * edge / height, edge);
  const double rim = height - wall / 2;
  for (int i = 0; i <= kRimSteps; ++i) {
    const double angle = kPi * i / kRimSteps;
    add(flare - wall / 2 + wall / 2 * std::cos(angle), rim + wall / 2 * std::sin(angle));
  }
  add(flare * 2 * wall / height - wall, 2 * wall);
  add(-wall - 0.3 * edge, wall + 0.3 * edge);
  add(-wall - edge, wall);
  return MakeLoft(rings);
}

Shape MakeCup(double bottom_radius, double top_radius, double height, double wall, int segments) {
  const double edge = wall / 3;
  const double lean = (top_radius - bottom_radius) / height;
  std::vector<Eigen::Vector2d> profile{{0, 0},
                                       {bottom_radius - edge, 0},
                                       {bottom_radius - 0.3 * edge, 0.3 * edge},
                                       {bottom_radius + lean * edge, edge}};
  // A few rings up the walls, so that light on them is smooth.
  constexpr int kWallSteps = 4;
  const double rim = height - wall / 2;
  for (int i = 1; i < kWallSteps; ++i) {
    const double z = rim * i / kWallSteps;
    profile.emplace_back(bottom_radius + lean * z, z);
  }
  for (int i = 0; i <= kRimSteps; ++i) {
    const double angle = kPi * i / kRimSteps;
    profile.emplace_back(top_radius - wall / 2 + wall / 2 * std::cos(angle),
                         rim + wall / 2 * std::sin(angle));
  }
  for (int i = kWallSteps - 1; i > 0; --i) {
    const double z = 2 * wall + (rim - 2 * wall) * i / kWallSteps;
    profile.emplace_back(bottom_radius + lean * z - wall, z);
  }
  profile.emplace_back(bottom_radius + lean * 2 * wall - wall, 2 * wall);
  profile.emplace_back(bottom_radius - 1.3 * wall, 1.3 * wall);
  profile.emplace_back(bottom_radius - 2 * wall, wall);
  profile.emplace_back(0, wall);
  return MakeLathe(profile, segments);
}

}  // namespace tsdfpp
