#include "metrics/truth_surface.h"

#include <limits>

#include "metrics/mesh_tools.h"

namespace tsdfpp {

namespace {

const TriangleMesh kNothing;

}  // namespace

TruthSurface::TruthSurface(TrueModel model, bool closed)
    : model_(std::move(model)),
      index_O_(model_.mesh_O),
      solid_O_(closed ? model_.mesh_O : kNothing),
      bounds_O_(BoundsOf(model_.mesh_O)) {}

NearestTruth FindNearestTruth(std::span<const Eigen::Vector3f> points_W,
                              std::span<const PlacedTruth> truths,
                              std::span<const float> within_m) {
  NearestTruth out;
  out.distance_m.assign(points_W.size(), std::numeric_limits<float>::infinity());
  if (!within_m.empty()) out.distance_m.assign(within_m.begin(), within_m.end());
  out.object.assign(points_W.size(), kNoInstance);
  out.triangle.assign(points_W.size(), NearestSurface::kNone);
  std::vector<std::size_t> asked;
  std::vector<Eigen::Vector3f> points_O;
  for (const PlacedTruth& truth : truths) {
    if (truth.surface->model().mesh_O.triangles.empty()) continue;
    // A surface is no nearer than its box, which spares most points the query.
    const Pose T_OW = truth.T_WO.inverse();
    asked.clear();
    points_O.clear();
    for (std::size_t i = 0; i < points_W.size(); ++i) {
      const Eigen::Vector3f p_O = (T_OW * points_W[i].cast<double>()).cast<float>();
      if (truth.surface->bounds_O().exteriorDistance(p_O) >= out.distance_m[i]) continue;
      asked.push_back(i);
      points_O.push_back(p_O);
    }
    const NearestSurface nearest = truth.surface->index_O().Nearest(points_O);
    for (std::size_t k = 0; k < asked.size(); ++k) {
      if (nearest.distance_m[k] >= out.distance_m[asked[k]]) continue;
      out.distance_m[asked[k]] = nearest.distance_m[k];
      out.object[asked[k]] = truth.surface->id();
      out.triangle[asked[k]] = nearest.triangle[k];
    }
  }
  return out;
}

std::vector<std::uint8_t> InsideTruth(std::span<const Eigen::Vector3f> points_W,
                                      std::span<const PlacedTruth> truths) {
  std::vector<std::uint8_t> inside(points_W.size(), 0);
  std::vector<Eigen::Vector3f> points_O(points_W.size());
  for (const PlacedTruth& truth : truths) {
    const Pose T_OW = truth.T_WO.inverse();
    for (std::size_t i = 0; i < points_W.size(); ++i) {
      points_O[i] = (T_OW * points_W[i].cast<double>()).cast<float>();
    }
    const std::vector<std::uint8_t> here = truth.surface->solid_O().Contains(points_O);
    for (std::size_t i = 0; i < inside.size(); ++i) inside[i] |= here[i];
  }
  return inside;
}

}  // namespace tsdfpp
