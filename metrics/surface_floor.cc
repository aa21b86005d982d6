#include "metrics/surface_floor.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <tuple>

#include "metrics/mesh_tools.h"
#include "metrics/point_index.h"

namespace tsdfpp {
namespace {

// For each vertex the number of the place it is at.
std::vector<std::uint32_t> Places(const TriangleMesh& mesh) {
  const auto key = [&](std::uint32_t i) {
    const Eigen::Vector3f& p = mesh.vertices[i];
    return std::tuple(p.x(), p.y(), p.z());
  };
  std::vector<std::uint32_t> order(mesh.vertices.size());
  std::iota(order.begin(), order.end(), 0U);
  std::sort(order.begin(), order.end(),
            [&](std::uint32_t a, std::uint32_t b) { return key(a) < key(b); });
  std::vector<std::uint32_t> places(order.size(), 0);
  std::uint32_t place = 0;
  for (std::size_t i = 0; i < order.size(); ++i) {
    if (i > 0 && key(order[i - 1]) != key(order[i])) ++place;
    places[order[i]] = place;
  }
  return places;
}

}  // namespace

Measured SamplingFloor_m(const TriangleMesh& points) {
  if (points.vertices.size() < 2) return Measured::Undefined("fewer than two points");
  const std::vector<double> spacings = PointIndex(points.vertices).Spacings_m();
  return Measured::Of(std::accumulate(spacings.begin(), spacings.end(), 0.0) /
                      static_cast<double>(spacings.size()));
}

Measured TessellationFloor_m(const TriangleMesh& mesh) {
  const std::size_t faces = mesh.triangles.size();
  if (faces > kMostFacesForFloor) {
    return Measured::Undefined(
        fmt::format("not computed for more than {} faces", kMostFacesForFloor));
  }
  const std::vector<std::uint32_t> places = Places(mesh);
  std::vector<Eigen::Vector3d> area(faces);
  // The faces around each place (a counting sort).
  std::vector<std::size_t> first(mesh.vertices.size() + 1, 0);
  for (std::size_t t = 0; t < faces; ++t) {
    area[t] = AreaVector(mesh, t);
    for (const std::uint32_t v : mesh.triangles[t]) ++first[places[v] + 1];
  }
  for (std::size_t p = 1; p < first.size(); ++p) first[p] += first[p - 1];
  std::vector<std::uint32_t> around(3 * faces);
  std::vector<std::size_t> next(first.begin(), first.end() - 1);
  for (std::size_t t = 0; t < faces; ++t) {
    for (const std::uint32_t v : mesh.triangles[t]) {
      around[next[places[v]]++] = static_cast<std::uint32_t>(t);
    }
  }

  const double kCreaseCosine = std::sqrt(0.5);
  double stray = 0;
  double total = 0;
  for (std::size_t t = 0; t < faces; ++t) {
    const double area_m2 = area[t].norm();
    if (!(area_m2 > 0)) continue;
    std::array<Eigen::Vector3d, 3> normal;
    std::array<Eigen::Vector3d, 3> corner;
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t place = places[mesh.triangles[t][k]];
      Eigen::Vector3d sum = Eigen::Vector3d::Zero();
      for (std::size_t i = first[place]; i < first[place + 1]; ++i) {
        const Eigen::Vector3d& other = area[around[i]];
        if (other.dot(area[t]) >= kCreaseCosine * other.norm() * area_m2) sum += other;
      }
      normal[k] = sum.normalized();
      corner[k] = Corner(mesh, t, static_cast<int>(k)).cast<double>();
    }
    double sum = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      const std::size_t j = (k + 1) % 3;
      sum += (normal[j] - normal[k]).dot(corner[j] - corner[k]);
    }
    stray += area_m2 * std::abs(sum) / 24;
    total += area_m2;
  }
  if (!(total > 0)) return Measured::Undefined("no face has an area");
  return Measured::Of(stray / total);
}

double RoundingFloor_m(const TriangleMesh& mesh) {
  float largest = 0;
  for (const Eigen::Vector3f& vertex : mesh.vertices) {
    largest = std::max(largest, vertex.cwiseAbs().maxCoeff());
  }
  return 0.5 * static_cast<double>(std::numeric_limits<float>::epsilon()) *
         static_cast<double>(largest);
}

}  // namespace tsdfpp
