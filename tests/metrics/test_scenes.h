// Analytic meshes and depth images for the metrics' tests.
#pragma once

#include <cmath>
#include <functional>
#include <numbers>
#include <optional>

#include "core/random.h"
#include "core/types.h"

namespace tsdfpp::testing {

inline constexpr double kFloat_m = 1e-6;  // single precision in coordinates of a metre

inline void Append(TriangleMesh& to, const TriangleMesh& from) {
  const auto first = static_cast<std::uint32_t>(to.vertices.size());
  to.vertices.insert(to.vertices.end(), from.vertices.begin(), from.vertices.end());
  for (const auto& t : from.triangles) {
    to.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
  }
  to.face_ids.insert(to.face_ids.end(), from.face_ids.begin(), from.face_ids.end());
}

// The rectangle corner + s a + t b, s and t in [0, 1], cut in cells; its normal is along a x b.
inline TriangleMesh Sheet(const Eigen::Vector3f& corner, const Eigen::Vector3f& a,
                          const Eigen::Vector3f& b, int cells = 1) {
  TriangleMesh mesh;
  const auto n = static_cast<std::uint32_t>(cells);
  for (std::uint32_t t = 0; t <= n; ++t) {
    for (std::uint32_t s = 0; s <= n; ++s) {
      mesh.vertices.emplace_back(corner + static_cast<float>(s) / static_cast<float>(n) * a +
                                 static_cast<float>(t) / static_cast<float>(n) * b);
    }
  }
  for (std::uint32_t t = 0; t < n; ++t) {
    for (std::uint32_t s = 0; s < n; ++s) {
      const std::uint32_t i = t * (n + 1) + s;
      mesh.triangles.push_back({i, i + 1, i + n + 2});
      mesh.triangles.push_back({i, i + n + 2, i + n + 1});
    }
  }
  return mesh;
}

inline TriangleMesh Box(const Eigen::Vector3f& low, const Eigen::Vector3f& high, int cells = 1) {
  const Eigen::Vector3f size = high - low;
  const Eigen::Vector3f x(size.x(), 0, 0);
  const Eigen::Vector3f y(0, size.y(), 0);
  const Eigen::Vector3f z(0, 0, size.z());
  TriangleMesh mesh;
  Append(mesh, Sheet(low, y, x, cells));
  Append(mesh, Sheet(low + z, x, y, cells));
  Append(mesh, Sheet(low, x, z, cells));
  Append(mesh, Sheet(low + y, z, x, cells));
  Append(mesh, Sheet(low, z, y, cells));
  Append(mesh, Sheet(low + x, y, z, cells));
  return mesh;
}

inline TriangleMesh Sphere(float radius, int rings = 64) {
  TriangleMesh mesh;
  const auto n = static_cast<std::uint32_t>(rings);
  for (std::uint32_t r = 0; r <= n; ++r) {
    const double polar = std::numbers::pi * r / n;
    for (std::uint32_t s = 0; s < 2 * n; ++s) {
      const double azimuth = std::numbers::pi * s / n;
      mesh.vertices.emplace_back(radius * Eigen::Vector3d(std::sin(polar) * std::cos(azimuth),
                                                          std::sin(polar) * std::sin(azimuth),
                                                          std::cos(polar))
                                              .cast<float>());
    }
  }
  for (std::uint32_t r = 0; r < n; ++r) {
    for (std::uint32_t s = 0; s < 2 * n; ++s) {
      const std::uint32_t a = r * 2 * n + s;
      const std::uint32_t b = r * 2 * n + (s + 1) % (2 * n);
      if (r > 0) mesh.triangles.push_back({a, a + 2 * n, b});
      if (r + 1 < n) mesh.triangles.push_back({b, a + 2 * n, b + 2 * n});
    }
  }
  return mesh;
}

inline void Flip(TriangleMesh& mesh) {
  for (auto& t : mesh.triangles) std::swap(t[1], t[2]);
}

inline void Label(TriangleMesh& mesh, InstanceId id) {
  mesh.face_ids.assign(mesh.triangles.size(), id);
}

inline TrueModel Model(InstanceId id, TriangleMesh mesh) {
  TrueModel model;
  model.info = {id, "object" + std::to_string(id), ""};
  model.face_region.assign(mesh.triangles.size(), 0);
  model.regions = {"all"};
  model.mesh_O = std::move(mesh);
  return model;
}

// Seeded points in a box.
inline std::vector<Eigen::Vector3f> RandomPoints(std::size_t count, const Eigen::Vector3f& low,
                                                 const Eigen::Vector3f& high,
                                                 std::uint64_t seed = 7) {
  std::vector<Eigen::Vector3f> points;
  for (std::size_t i = 0; i < count; ++i) {
    const auto draw = UniformDraw(seed, 99, i);
    points.emplace_back(low.x() + static_cast<float>(draw[0]) * (high.x() - low.x()),
                        low.y() + static_cast<float>(draw[1]) * (high.y() - low.y()),
                        low.z() + static_cast<float>(draw[2]) * (high.z() - low.z()));
  }
  return points;
}

// What a ray meets: its z-depth and the object there.
struct Hit {
  double depth_m = 0;
  InstanceId id = kBackground;
};
// Casts every pixel's ray (x, y, 1), in the camera's frame, against an analytic scene.
inline Frame CastFrame(const std::function<std::optional<Hit>(double, double)>& scene,
                       Intrinsics camera = {320, 240, 300, 300, 159.5, 119.5}) {
  Frame frame;
  frame.intrinsics = camera;
  frame.depth = cv::Mat(camera.height, camera.width, CV_32FC1, cv::Scalar(0));
  frame.mask = cv::Mat(camera.height, camera.width, CV_16UC1, cv::Scalar(0));
  for (int v = 0; v < camera.height; ++v) {
    for (int u = 0; u < camera.width; ++u) {
      const auto hit = scene((u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy);
      if (!hit) continue;
      frame.depth.at<float>(v, u) = static_cast<float>(hit->depth_m);
      frame.mask.at<std::uint16_t>(v, u) = hit->id;
    }
  }
  return frame;
}

}  // namespace tsdfpp::testing
