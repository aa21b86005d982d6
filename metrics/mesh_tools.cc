#include "metrics/mesh_tools.h"

#include <algorithm>
#include <limits>

namespace tsdfpp {
namespace {

template <typename Keep>
TriangleMesh Select(const TriangleMesh& mesh, const Keep& keep) {
  constexpr std::uint32_t kUnused = std::numeric_limits<std::uint32_t>::max();
  std::vector<std::uint32_t> renamed(mesh.vertices.size(), kUnused);
  TriangleMesh out;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    if (!keep(t)) continue;
    std::array<std::uint32_t, 3> corners{};
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t vertex = mesh.triangles[t][k];
      if (renamed[vertex] == kUnused) {
        renamed[vertex] = static_cast<std::uint32_t>(out.vertices.size());
        out.vertices.push_back(mesh.vertices[vertex]);
        if (!mesh.colours.empty()) out.colours.push_back(mesh.colours[vertex]);
      }
      corners[k] = renamed[vertex];
    }
    out.triangles.push_back(corners);
    if (!mesh.face_ids.empty()) out.face_ids.push_back(mesh.face_ids[t]);
  }
  return out;
}

Eigen::Vector3f NearestOnSegment(const Eigen::Vector3f& point, const Eigen::Vector3f& a,
                                 const Eigen::Vector3f& b) {
  const Eigen::Vector3f edge = b - a;
  const float length2 = edge.squaredNorm();
  if (length2 <= 0.0F) return a;
  return a + std::clamp((point - a).dot(edge) / length2, 0.0F, 1.0F) * edge;
}

}  // namespace

Eigen::Vector3d AreaVector(const TriangleMesh& mesh, std::size_t triangle) {
  const Eigen::Vector3d a = Corner(mesh, triangle, 0).cast<double>();
  const Eigen::Vector3d ab = Corner(mesh, triangle, 1).cast<double>() - a;
  const Eigen::Vector3d ac = Corner(mesh, triangle, 2).cast<double>() - a;
  return 0.5 * ab.cross(ac);
}

double SurfaceArea(const TriangleMesh& mesh) {
  double area = 0;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) area += AreaVector(mesh, t).norm();
  return area;
}

TriangleMesh FacesOf(const TriangleMesh& mesh, InstanceId id) {
  if (mesh.face_ids.empty()) return {};
  return Select(mesh, [&](std::size_t t) { return mesh.face_ids[t] == id; });
}

TriangleMesh FacesWithout(const TriangleMesh& mesh, const std::set<InstanceId>& ids) {
  return Select(mesh, [&](std::size_t t) {
    return mesh.face_ids.empty() || !ids.contains(mesh.face_ids[t]);
  });
}

TriangleMesh FacesNear(const TriangleMesh& mesh, const Eigen::AlignedBox3f& box) {
  return Select(mesh, [&](std::size_t t) {
    Eigen::AlignedBox3f bounds(Corner(mesh, t, 0));
    bounds.extend(Corner(mesh, t, 1)).extend(Corner(mesh, t, 2));
    return bounds.intersects(box);
  });
}

Eigen::AlignedBox3f BoundsOf(const TriangleMesh& mesh) {
  Eigen::AlignedBox3f box;
  for (const Eigen::Vector3f& vertex : mesh.vertices) box.extend(vertex);
  return box;
}

float PointTriangleDistance(const Eigen::Vector3f& point, const Eigen::Vector3f& a,
                            const Eigen::Vector3f& b, const Eigen::Vector3f& c) {
  const Eigen::Vector3f normal = (b - a).cross(c - a);
  const float normal2 = normal.squaredNorm();
  if (normal2 > 0.0F) {
    // Over the triangle's inside the distance is that to its plane.
    const bool inside = (b - a).cross(point - a).dot(normal) >= 0.0F &&
                        (c - b).cross(point - b).dot(normal) >= 0.0F &&
                        (a - c).cross(point - c).dot(normal) >= 0.0F;
    if (inside) return std::abs((point - a).dot(normal)) / std::sqrt(normal2);
  }
  return std::min({(point - NearestOnSegment(point, a, b)).norm(),
                   (point - NearestOnSegment(point, b, c)).norm(),
                   (point - NearestOnSegment(point, c, a)).norm()});
}

}  // namespace tsdfpp
