// The only file that includes Open3D. Of its RaycastingScene as Debian builds it, only the distance
// queries are right (docs/sources.md, "Open3D's distances"), so nothing else of it is used.
#include "metrics/surface_index.h"

#include <open3d/core/Tensor.h>
#include <open3d/t/geometry/RaycastingScene.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstdlib>
#include <cstring>
#include <utility>

#include "metrics/mesh_tools.h"

namespace tsdfpp {

using open3d::core::Tensor;

namespace {

// A triangle with an edge shorter than this share of the farthest query's distance (or than
// kShortestEdge_m) is left out of the index: Open3D's closest point divides by an edge's squared
// length, taken in single precision as a difference of products with the query's distance, which
// vanishes below this length, and Debian's build aborts on the NaN. What is left out is a sliver of
// this width along its neighbours.
constexpr double kShortestEdge = 6.25e-8;
constexpr double kShortestEdge_m = 5e-6;

bool IsSliver(const TriangleMesh& mesh, std::size_t triangle, float shortest_m) {
  for (int i = 0; i < 3; ++i) {
    const Eigen::Vector3f edge = Corner(mesh, triangle, (i + 1) % 3) - Corner(mesh, triangle, i);
    if (edge.norm() < shortest_m) return true;
  }
  return false;
}

using Corners = std::array<Eigen::Vector3f, 3>;

bool IsBefore(const Eigen::Vector3f& a, const Eigen::Vector3f& b) {
  return std::lexicographical_compare(a.data(), a.data() + 3, b.data(), b.data() + 3);
}

// The corners, the least one first, so that a triangle has one name whichever it begins with. One
// that faces the other way has another.
Corners NamedCorners(const TriangleMesh& mesh, std::size_t triangle) {
  Corners corners{Corner(mesh, triangle, 0), Corner(mesh, triangle, 1), Corner(mesh, triangle, 2)};
  std::rotate(corners.begin(), std::min_element(corners.begin(), corners.end(), IsBefore),
              corners.end());
  return corners;
}

std::uint64_t HashOf(const Corners& corners) {
  std::uint64_t hash = 0xcbf29ce484222325U;
  for (const Eigen::Vector3f& corner : corners) {
    for (const float value : corner) {
      // -0 equals 0.
      hash = (hash ^ std::bit_cast<std::uint32_t>(value + 0.0F)) * 0x100000001b3U;
      hash ^= hash >> 29U;
    }
  }
  return hash;
}

// Of triangles that are equal, all but the first: a tree cannot part them, and queries then take
// time with their number.
std::vector<bool> FindRepeated(const TriangleMesh& mesh) {
  std::vector<std::pair<std::uint64_t, std::uint32_t>> sorted(mesh.triangles.size());
  for (std::uint32_t t = 0; t < sorted.size(); ++t) sorted[t] = {HashOf(NamedCorners(mesh, t)), t};
  std::sort(sorted.begin(), sorted.end());
  std::vector<bool> repeated(sorted.size());
  for (std::size_t i = 1; i < sorted.size(); ++i) {
    // Others of the same hash would be between two equal ones by chance alone, and cost a repeat.
    repeated[sorted[i].second] =
        sorted[i].first == sorted[i - 1].first &&
        NamedCorners(mesh, sorted[i].second) == NamedCorners(mesh, sorted[i - 1].second);
  }
  return repeated;
}

}  // namespace

struct SurfaceIndex::Impl {
  std::vector<std::uint32_t> indexed;  // the mesh's triangle of each that is in the scene
  // Embree's queries do not change the scene, though Open3D does not declare them const.
  mutable open3d::t::geometry::RaycastingScene scene;
};

SurfaceIndex::SurfaceIndex(TriangleMesh mesh, double farthest_query_m) : mesh_(std::move(mesh)) {
  if (mesh_.triangles.empty()) return;
  normals_.reserve(mesh_.triangles.size());
  for (std::size_t t = 0; t < mesh_.triangles.size(); ++t) {
    const Eigen::Vector3d area = AreaVector(mesh_, t);
    const double length = area.norm();
    normals_.push_back(length > 0 ? Eigen::Vector3f((area / length).cast<float>())
                                  : Eigen::Vector3f(Eigen::Vector3f::Zero()));
  }
  static_assert(sizeof(Eigen::Vector3f) == 3 * sizeof(float));
  Tensor vertices({static_cast<std::int64_t>(mesh_.vertices.size()), 3}, open3d::core::Float32);
  std::memcpy(vertices.GetDataPtr(), mesh_.vertices.data(),
              mesh_.vertices.size() * sizeof(Eigen::Vector3f));
  auto impl = std::make_unique<Impl>();
  std::vector<std::array<std::uint32_t, 3>> kept;
  const auto shortest_m =
      static_cast<float>(std::max(kShortestEdge_m, kShortestEdge * farthest_query_m));
  const std::vector<bool> repeated = FindRepeated(mesh_);
  for (std::size_t t = 0; t < mesh_.triangles.size(); ++t) {
    if (repeated[t] || IsSliver(mesh_, t, shortest_m)) continue;
    kept.push_back(mesh_.triangles[t]);
    impl->indexed.push_back(static_cast<std::uint32_t>(t));
  }
  if (kept.empty()) return;
  Tensor triangles({static_cast<std::int64_t>(kept.size()), 3}, open3d::core::UInt32);
  std::memcpy(triangles.GetDataPtr(), kept.data(), kept.size() * sizeof(kept[0]));
  impl_ = std::move(impl);
  impl_->scene.AddTriangles(vertices, triangles);
  // Open3D builds the tree at the first query: ask one now, so that later ones only read.
  impl_->scene.ComputeClosestPoints(Tensor::Zeros({1, 3}, open3d::core::Float32));
}

std::size_t SurfaceIndex::indexed() const { return impl_ == nullptr ? 0 : impl_->indexed.size(); }

SurfaceIndex::~SurfaceIndex() = default;
SurfaceIndex::SurfaceIndex(SurfaceIndex&&) noexcept = default;
SurfaceIndex& SurfaceIndex::operator=(SurfaceIndex&&) noexcept = default;

NearestSurface SurfaceIndex::Nearest(std::span<const Eigen::Vector3f> points) const {
  NearestSurface out;
  out.distance_m.assign(points.size(), std::numeric_limits<float>::infinity());
  out.triangle.assign(points.size(), NearestSurface::kNone);
  out.normal.assign(points.size(), Eigen::Vector3f::Zero());
  out.position.assign(points.size(), Eigen::Vector3f::Zero());
  if (impl_ == nullptr || points.empty()) return out;

  Tensor queries({static_cast<std::int64_t>(points.size()), 3}, open3d::core::Float32);
  std::memcpy(queries.GetDataPtr(), points.data(), points.size_bytes());
  auto answers = impl_->scene.ComputeClosestPoints(queries);
  const Tensor positions = answers.at("points").Contiguous();
  const Tensor ids = answers.at("primitive_ids").Contiguous();
  const auto* position = static_cast<const float*>(positions.GetDataPtr());
  const auto* id = static_cast<const std::uint32_t*>(ids.GetDataPtr());
  for (std::size_t i = 0; i < points.size(); ++i) {
    // Nothing is nearest where single precision has no number for the distance: those who read
    // files keep such coordinates out (core/farthest.h).
    if (id[i] >= impl_->indexed.size()) std::abort();
    out.position[i] = Eigen::Vector3f(position + 3 * i);
    out.distance_m[i] = (points[i] - out.position[i]).norm();
    out.triangle[i] = impl_->indexed[id[i]];
    out.normal[i] = normals_[out.triangle[i]];
  }
  return out;
}

}  // namespace tsdfpp
