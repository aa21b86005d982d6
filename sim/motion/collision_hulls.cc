// Convex pieces that stand for a model's parts when they collide.
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "sim/motion/physics_bake.h"

namespace tsdfpp {
namespace {

using Points = std::vector<Eigen::Vector3d>;

// The part of a convex polygon where normal * p <= offset (Sutherland & Hodgman 1974).
Points Clip(const Points& polygon, const Eigen::Vector3d& normal, double offset) {
  Points kept;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Eigen::Vector3d& a = polygon[i];
    const Eigen::Vector3d& b = polygon[(i + 1) % polygon.size()];
    const double above_a = normal.dot(a) - offset;
    const double above_b = normal.dot(b) - offset;
    if (above_a <= 0) kept.push_back(a);
    if ((above_a < 0 && above_b > 0) || (above_a > 0 && above_b < 0)) {
      kept.push_back(a + above_a / (above_a - above_b) * (b - a));
    }
  }
  return kept;
}

struct HalfSpace {
  Eigen::Vector3d normal;
  double offset;
};

// The corners of a shape's surface inside the half spaces.
Points SurfaceInside(const Shape& shape, const std::vector<HalfSpace>& sides) {
  Points inside;
  for (const auto& [a, b, c] : shape.triangles) {
    Points polygon{shape.vertices[a], shape.vertices[b], shape.vertices[c]};
    for (const HalfSpace& side : sides) {
      if (polygon.empty()) break;
      polygon = Clip(polygon, side.normal, side.offset);
    }
    inside.insert(inside.end(), polygon.begin(), polygon.end());
  }
  return inside;
}

// A hull needs a volume: points that all lie near one plane have none.
bool HasVolume(const Points& points) {
  constexpr double kLeastThickness_m = 1e-4;
  if (points.size() < 4) return false;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& p : points) mean += p / static_cast<double>(points.size());
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector3d& p : points) spread += (p - mean) * (p - mean).transpose();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(spread);
  const Eigen::Vector3d normal = axes.eigenvectors().col(0);
  double low = std::numeric_limits<double>::infinity();
  double high = -low;
  for (const Eigen::Vector3d& p : points) {
    low = std::min(low, normal.dot(p));
    high = std::max(high, normal.dot(p));
  }
  return high - low > kLeastThickness_m;
}

void AddCells(const Shape& shape, std::vector<Points>& hulls) {
  double low = std::numeric_limits<double>::infinity();
  double high = -low;
  for (const Eigen::Vector3d& p : shape.vertices) {
    low = std::min(low, p.z());
    high = std::max(high, p.z());
  }
  const Eigen::Vector3d up = Eigen::Vector3d::UnitZ();
  const double sector = 2 * std::numbers::pi / kCellSectors;
  for (int s = 0; s < kCellSectors; ++s) {
    const Eigen::Vector3d right(std::sin(s * sector), -std::cos(s * sector), 0);
    const Eigen::Vector3d left(-std::sin((s + 1) * sector), std::cos((s + 1) * sector), 0);
    for (int layer = 0; layer < kCellLayers; ++layer) {
      const double bottom = low + (high - low) * layer / kCellLayers;
      const double top = low + (high - low) * (layer + 1) / kCellLayers;
      Points cell = SurfaceInside(shape, {{right, 0}, {left, 0}, {-up, -bottom}, {up, top}});
      if (HasVolume(cell)) hulls.push_back(std::move(cell));
    }
  }
}

// Whether no vertex stands out of the planes of its faces, but for faces of a small share of the
// area: rounded corners end in slivers that may be folded. Of a large mesh a part is asked.
bool IsConvex(const Shape& shape) {
  constexpr std::size_t kMostAsked = 1000;
  constexpr double kFoldedShare = 0.02;
  const std::size_t vertex_step = shape.vertices.size() / kMostAsked + 1;
  const std::size_t face_step = shape.triangles.size() / kMostAsked + 1;
  double area = 0;
  double concave = 0;
  for (std::size_t f = 0; f < shape.triangles.size(); f += face_step) {
    const auto& [a, b, c] = shape.triangles[f];
    const Eigen::Vector3d twice_area =
        (shape.vertices[b] - shape.vertices[a]).cross(shape.vertices[c] - shape.vertices[a]);
    const Eigen::Vector3d normal = twice_area.normalized();
    const double offset = normal.dot(shape.vertices[a]);
    area += twice_area.norm();
    for (std::size_t v = 0; v < shape.vertices.size(); v += vertex_step) {
      if (normal.dot(shape.vertices[v]) - offset <= kConvexTolerance_m) continue;
      concave += twice_area.norm();
      break;
    }
  }
  return concave <= kFoldedShare * area;
}

}  // namespace

std::vector<std::vector<Eigen::Vector3d>> CollisionHulls(const std::vector<ModelPart>& parts) {
  std::vector<Points> hulls;
  for (const ModelPart& part : parts) {
    if (!IsConvex(part.shape)) {
      AddCells(part.shape, hulls);
    } else if (HasVolume(part.shape.vertices)) {
      hulls.push_back(part.shape.vertices);
    }
  }
  return hulls;
}

}  // namespace tsdfpp
