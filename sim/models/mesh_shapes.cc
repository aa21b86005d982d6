#include "sim/models/mesh_shapes.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <utility>

namespace tsdfpp {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr int kBevelSteps = 4;       // polygon steps of a rounded rim
constexpr int kCornerSteps = 6;      // of a rounded corner of a profile
constexpr int kBallSteps = 32;       // pole to pole
constexpr int kHandleSteps = 24;     // along the half ring
constexpr int kHandleSegments = 24;  // around the tube

std::uint32_t Index(std::size_t i) { return static_cast<std::uint32_t>(i); }

void AddQuad(Shape& shape, std::uint32_t a, std::uint32_t b, std::uint32_t c, std::uint32_t d) {
  shape.triangles.push_back({a, b, c});
  shape.triangles.push_back({a, c, d});
}

// Joins closed rings of `count` vertices each, stored one after the other, then closes both ends
// with fans around their centroids. The rings run clockwise seen against the direction of stacking.
Shape JoinRings(std::vector<Eigen::Vector3d> vertices, std::size_t count) {
  Shape shape;
  shape.vertices = std::move(vertices);
  const std::size_t rings = shape.vertices.size() / count;
  for (std::size_t r = 0; r + 1 < rings; ++r) {
    for (std::size_t i = 0; i < count; ++i) {
      const std::size_t next = (i + 1) % count;
      AddQuad(shape, Index(r * count + i), Index(r * count + next), Index((r + 1) * count + next),
              Index((r + 1) * count + i));
    }
  }
  for (const bool last : {false, true}) {
    const std::size_t first = last ? (rings - 1) * count : 0;
    Eigen::Vector3d centre = Eigen::Vector3d::Zero();
    for (std::size_t i = 0; i < count; ++i) centre += shape.vertices[first + i];
    shape.vertices.emplace_back(centre / static_cast<double>(count));
    const std::uint32_t c = Index(shape.vertices.size() - 1);
    for (std::size_t i = 0; i < count; ++i) {
      const std::uint32_t a = Index(first + i);
      const std::uint32_t b = Index(first + (i + 1) % count);
      if (last) {
        shape.triangles.push_back({c, a, b});
      } else {
        shape.triangles.push_back({c, b, a});
      }
    }
  }
  return shape;
}

// A generator that stacked its rings the other way round is turned inside out here, once.
Shape Outwards(Shape shape) {
  if (SignedVolume(shape) < 0) {
    for (auto& triangle : shape.triangles) std::swap(triangle[1], triangle[2]);
  }
  return shape;
}

// The convex polygon moved inwards by `distance`.
std::vector<Eigen::Vector2d> Inset(const std::vector<Eigen::Vector2d>& polygon, double distance) {
  const std::size_t n = polygon.size();
  std::vector<Eigen::Vector2d> inset(n);
  for (std::size_t i = 0; i < n; ++i) {
    const Eigen::Vector2d before = (polygon[i] - polygon[(i + n - 1) % n]).normalized();
    const Eigen::Vector2d after = (polygon[(i + 1) % n] - polygon[i]).normalized();
    const Eigen::Vector2d normal_before(-before.y(), before.x());
    const Eigen::Vector2d normal_after(-after.y(), after.x());
    const double cosine = normal_before.dot(normal_after);
    inset[i] = polygon[i] + distance * (normal_before + normal_after) / (1.0 + cosine);
  }
  return inset;
}

}  // namespace

Shape MakeBox(const Eigen::Vector3d& low, const Eigen::Vector3d& high, double cell_m) {
  const Eigen::Vector3d size = high - low;
  std::array<int, 3> cells{};
  for (int k = 0; k < 3; ++k) {
    cells[k] = std::max(1, static_cast<int>(std::ceil(size[k] / cell_m - 1e-9)));
  }
  Shape shape;
  // Grid points on the surface only, shared between faces so that the mesh is closed.
  std::map<std::array<int, 3>, std::uint32_t> index;
  const auto vertex = [&](const std::array<int, 3>& at) {
    const auto [entry, is_new] = index.try_emplace(at, Index(shape.vertices.size()));
    if (is_new) {
      Eigen::Vector3d point;
      for (int k = 0; k < 3; ++k) point[k] = low[k] + size[k] * at[k] / cells[k];
      shape.vertices.push_back(point);
    }
    return entry->second;
  };
  for (int axis = 0; axis < 3; ++axis) {
    const int u = (axis + 1) % 3;
    const int v = (axis + 2) % 3;
    for (const bool top : {false, true}) {
      for (int i = 0; i < cells[u]; ++i) {
        for (int j = 0; j < cells[v]; ++j) {
          std::array<std::uint32_t, 4> corner{};
          constexpr std::array<std::array<int, 2>, 4> kSteps{{{0, 0}, {1, 0}, {1, 1}, {0, 1}}};
          for (int c = 0; c < 4; ++c) {
            std::array<int, 3> at{};
            at[axis] = top ? cells[axis] : 0;
            at[u] = i + kSteps[c][0];
            at[v] = j + kSteps[c][1];
            corner[c] = vertex(at);
          }
          if (top) {
            AddQuad(shape, corner[0], corner[1], corner[2], corner[3]);
          } else {
            AddQuad(shape, corner[0], corner[3], corner[2], corner[1]);
          }
        }
      }
    }
  }
  return shape;
}

Shape MakeExtrusion(const std::vector<Eigen::Vector2d>& polygon_xz, double half_width,
                    double bevel) {
  std::vector<std::pair<double, double>> rings;  // y and inset
  for (int i = 0; i <= kBevelSteps; ++i) {
    const double angle = kPi / 2 * i / kBevelSteps;
    rings.emplace_back(-half_width + bevel * (1 - std::sin(angle)), bevel * (1 - std::cos(angle)));
  }
  std::reverse(rings.begin(), rings.end());
  const std::size_t one_side = rings.size();
  for (std::size_t i = one_side; i-- > 0;) rings.emplace_back(-rings[i].first, rings[i].second);
  std::vector<Eigen::Vector3d> vertices;
  for (const auto& [y, inset] : rings) {
    for (const Eigen::Vector2d& p : Inset(polygon_xz, inset))
      vertices.emplace_back(p.x(), y, p.y());
  }
  return Outwards(JoinRings(std::move(vertices), polygon_xz.size()));
}

std::vector<Eigen::Vector2d> RoundedRectangle(const Eigen::Vector2d& low,
                                              const Eigen::Vector2d& high, double radius) {
  const std::array<Eigen::Vector2d, 4> centres{
      Eigen::Vector2d(high.x() - radius, low.y() + radius),
      Eigen::Vector2d(high.x() - radius, high.y() - radius),
      Eigen::Vector2d(low.x() + radius, high.y() - radius),
      Eigen::Vector2d(low.x() + radius, low.y() + radius)};
  std::vector<Eigen::Vector2d> polygon;
  for (int corner = 0; corner < 4; ++corner) {
    for (int i = 0; i <= kCornerSteps; ++i) {
      const double angle = kPi / 2 * (corner - 1 + static_cast<double>(i) / kCornerSteps);
      polygon.emplace_back(centres[corner] +
                           radius * Eigen::Vector2d(std::cos(angle), std::sin(angle)));
    }
  }
  return polygon;
}

Shape MakeLathe(const std::vector<Eigen::Vector2d>& profile_rz, int segments) {
  Shape shape;
  const std::size_t rings = profile_rz.size() - 2;
  const auto n = static_cast<std::size_t>(segments);
  for (std::size_t r = 1; r <= rings; ++r) {
    for (int s = 0; s < segments; ++s) {
      const double angle = 2 * kPi * s / segments;
      shape.vertices.emplace_back(profile_rz[r].x() * std::cos(angle),
                                  profile_rz[r].x() * std::sin(angle), profile_rz[r].y());
    }
  }
  const std::uint32_t bottom = Index(shape.vertices.size());
  shape.vertices.emplace_back(0, 0, profile_rz.front().y());
  const std::uint32_t top = bottom + 1;
  shape.vertices.emplace_back(0, 0, profile_rz.back().y());
  for (std::size_t s = 0; s < n; ++s) {
    const std::size_t next = (s + 1) % n;
    shape.triangles.push_back({bottom, Index(next), Index(s)});
    for (std::size_t r = 0; r + 1 < rings; ++r) {
      AddQuad(shape, Index(r * n + s), Index(r * n + next), Index((r + 1) * n + next),
              Index((r + 1) * n + s));
    }
    shape.triangles.push_back({top, Index((rings - 1) * n + s), Index((rings - 1) * n + next)});
  }
  return shape;
}

std::vector<Eigen::Vector2d> CylinderProfile(double radius, double low, double high, double bevel) {
  std::vector<Eigen::Vector2d> profile{{0, low}};
  for (const bool top : {false, true}) {
    for (int i = 0; i <= kBevelSteps; ++i) {
      const double angle = kPi / 2 * (static_cast<double>(i) / kBevelSteps - (top ? 0 : 1));
      profile.emplace_back(radius - bevel + bevel * std::cos(angle),
                           (top ? high - bevel : low + bevel) + bevel * std::sin(angle));
    }
  }
  profile.emplace_back(0, high);
  return profile;
}

std::vector<Eigen::Vector2d> BallProfile(double radius, double centre_z) {
  std::vector<Eigen::Vector2d> profile;
  for (int i = 0; i <= kBallSteps; ++i) {
    const double angle = kPi * i / kBallSteps;
    profile.emplace_back(radius * std::sin(angle), centre_z - radius * std::cos(angle));
  }
  return profile;
}

Shape MakeHandle(double ring, double tube) {
  std::vector<Eigen::Vector3d> vertices;
  for (int i = 0; i <= kHandleSteps; ++i) {
    const double along = kPi * (static_cast<double>(i) / kHandleSteps - 0.5);
    const Eigen::Vector3d outwards(std::cos(along), 0, std::sin(along));
    for (int s = 0; s < kHandleSegments; ++s) {
      const double around = 2 * kPi * s / kHandleSegments;
      vertices.emplace_back((ring + tube * std::cos(around)) * outwards +
                            tube * std::sin(around) * Eigen::Vector3d::UnitY());
    }
  }
  return Outwards(JoinRings(std::move(vertices), kHandleSegments));
}

Shape MakeLoft(const std::vector<std::vector<Eigen::Vector3d>>& rings) {
  std::vector<Eigen::Vector3d> vertices;
  for (const auto& ring : rings) vertices.insert(vertices.end(), ring.begin(), ring.end());
  return Outwards(JoinRings(std::move(vertices), rings.front().size()));
}

Shape Transformed(Shape shape, const Eigen::Isometry3d& T) {
  for (Eigen::Vector3d& vertex : shape.vertices) vertex = T * vertex;
  return shape;
}

Shape Translated(Shape shape, double x, double y, double z) {
  for (Eigen::Vector3d& vertex : shape.vertices) vertex += Eigen::Vector3d(x, y, z);
  return shape;
}

double SignedVolume(const Shape& shape) {
  double six_volumes = 0;
  for (const auto& [a, b, c] : shape.triangles) {
    six_volumes += shape.vertices[a].dot(shape.vertices[b].cross(shape.vertices[c]));
  }
  return six_volumes / 6;
}

}  // namespace tsdfpp
