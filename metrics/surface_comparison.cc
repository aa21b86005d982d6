#include "metrics/surface_comparison.h"

#include <algorithm>
#include <cmath>

#include "core/units.h"
#include "metrics/mesh_tools.h"
#include "metrics/normal_agreement.h"
#include "metrics/point_index.h"
#include "metrics/statistics.h"
#include "metrics/surface_floor.h"
#include "metrics/surface_samples.h"

namespace tsdfpp {
namespace {

// Longest sides that differ more than this are of different units, not of different coverage.
constexpr double kMostSizeRatio = 50;

// One of the two surfaces, sampled and indexed.
struct Side {
  const TriangleMesh& mesh;
  std::string name;
  Eigen::AlignedBox3f box;
  SampleSet samples;  // `normals` empty for points
  Measured samples_per_cm2;

  bool HasTriangles() const { return !mesh.triangles.empty(); }
};

Expected<Side> MakeSide(const TriangleMesh& mesh, const std::string& name,
                        const SurfaceComparisonConfig& config, std::uint32_t stream) {
  if (mesh.vertices.empty()) {
    return DataError("{}: holds no vertices, expected a surface or points", name);
  }
  Side side{mesh, name, BoundsOf(mesh), {}, Measured::Undefined("points, not a mesh")};
  for (const Eigen::Vector3f& vertex : mesh.vertices) {
    if (!vertex.allFinite()) return DataError("{}: a vertex has no finite x, y, z", name);
  }
  if (!side.HasTriangles()) {
    side.samples.points = mesh.vertices;
    return side;
  }
  const double area_cm2 = kCm2PerM2 * SurfaceArea(mesh);
  if (!(area_cm2 > 0)) {
    return DataError("{}: has {} faces but none of them has an area", name, mesh.triangles.size());
  }
  const double density =
      std::min(config.samples_per_cm2, static_cast<double>(config.max_samples) / area_cm2);
  side.samples = SampleMesh(mesh, density, config.seed, stream);
  side.samples_per_cm2 = Measured::Of(static_cast<double>(side.samples.size()) / area_cm2);
  return side;
}

std::string SizeText(const Eigen::AlignedBox3f& box) {
  const Eigen::Vector3f size = box.sizes();
  return fmt::format("{:.4g} x {:.4g} x {:.4g} m", size.x(), size.y(), size.z());
}

// What tells how far points are from a surface.
struct SideIndex {
  std::unique_ptr<SurfaceIndex> triangles;
  std::unique_ptr<PointIndex> points;  // where it has no triangles

  std::vector<double> Distances_m(std::span<const Eigen::Vector3f> from) const {
    if (!triangles) return points->Distances_m(from);
    const NearestSurface nearest = triangles->Nearest(from);
    return {nearest.distance_m.begin(), nearest.distance_m.end()};
  }
};

Expected<SideIndex> MakeIndex(const Side& side, double farthest_m) {
  SideIndex index;
  if (!side.HasTriangles()) {
    index.points = std::make_unique<PointIndex>(side.mesh.vertices);
    return index;
  }
  index.triangles = std::make_unique<SurfaceIndex>(side.mesh, farthest_m);
  if (index.triangles->indexed() == 0) {
    return DataError("{}: has {} faces, all of them too thin to measure distances to", side.name,
                     side.mesh.triangles.size());
  }
  return index;
}

DirectedDistances Summarise(std::vector<double> distances, const SurfaceComparisonConfig& config) {
  DirectedDistances out;
  out.samples = distances.size();
  std::sort(distances.begin(), distances.end());
  double sum = 0;
  double squares = 0;
  for (const double distance : distances) {
    sum += distance;
    squares += distance * distance;
  }
  const auto count = static_cast<double>(distances.size());
  out.mean_m = sum / count;
  out.rmse_m = std::sqrt(squares / count);
  constexpr double kHalf = 0.5;
  out.median_m = QuantileOfSorted(distances, kHalf);
  out.p90_m = QuantileOfSorted(distances, 0.90);
  out.p95_m = QuantileOfSorted(distances, 0.95);
  out.largest_m = distances.back();
  for (const double threshold : config.thresholds_m) {
    const auto above = std::upper_bound(distances.begin(), distances.end(), threshold);
    out.within.push_back(static_cast<double>(above - distances.begin()) / count);
  }
  return out;
}

// The vertices that faces use.
std::vector<Eigen::Vector3f> CornersOf(const TriangleMesh& mesh) {
  std::vector<Eigen::Vector3f> corners;
  std::vector<std::uint8_t> used(mesh.vertices.size(), 0);
  for (const auto& triangle : mesh.triangles) {
    for (const std::uint32_t v : triangle) {
      if (used[v] == 0) corners.push_back(mesh.vertices[v]);
      used[v] = 1;
    }
  }
  return corners;
}

DirectedDistances Measure(const Side& from, const Side& to, const SideIndex& index,
                          const SurfaceComparisonConfig& config) {
  DirectedDistances out = Summarise(index.Distances_m(from.samples.points), config);
  out.samples_per_cm2 = from.samples_per_cm2;
  out.to_triangles = to.HasTriangles();
  if (!from.HasTriangles()) return out;
  const std::vector<double> of_corners = index.Distances_m(CornersOf(from.mesh));
  out.largest_m = std::max(out.largest_m, *std::max_element(of_corners.begin(), of_corners.end()));
  return out;
}

// The scores that both directions make together.
void Combine(SurfaceComparison& out) {
  for (std::size_t k = 0; k < out.accuracy.within.size(); ++k) {
    const double precision = out.accuracy.within[k];
    const double recall = out.completeness.within[k];
    const double sum = precision + recall;
    out.f_score.push_back(sum > 0 ? 2 * precision * recall / sum : 0);
  }
  out.chamfer_sum_m = out.accuracy.mean_m + out.completeness.mean_m;
  out.chamfer_mean_m = 0.5 * out.chamfer_sum_m;
  out.chamfer_squared_m2 =
      out.accuracy.rmse_m * out.accuracy.rmse_m + out.completeness.rmse_m * out.completeness.rmse_m;
  out.hausdorff_m = std::max(out.accuracy.largest_m, out.completeness.largest_m);
}

// What makes every share 0 is said, since a 0 does not tell it from a bad reconstruction.
void RemarkOnOverlap(const Side& reconstruction, const Side& truth, double reach_m,
                     SurfaceComparison& out) {
  const double apart = static_cast<double>(reconstruction.box.exteriorDistance(truth.box));
  if (apart > reach_m) {
    out.remarks.push_back(fmt::format(
        "{} and {} do not overlap: their boxes are {:.4g} m apart. Are they in one frame? Nothing "
        "is aligned before it is measured",
        reconstruction.name, truth.name, apart));
    return;
  }
  if (out.accuracy.within.back() == 0 && out.completeness.within.back() == 0) {
    out.remarks.push_back(fmt::format(
        "no sample of {} is within {:.4g} m of {}, nor the other way round. Are they in one frame? "
        "Nothing is aligned before it is measured",
        reconstruction.name, reach_m, truth.name));
  }
}

// The scores that need to know which way surfaces face.
void ScoreFacing(const Side& reconstruction, const SurfaceIndex* our_triangles, const Side& truth,
                 const SurfaceIndex* true_triangles, const SurfaceComparisonConfig& config,
                 SurfaceComparison& out) {
  if (!reconstruction.HasTriangles() || !truth.HasTriangles()) {
    const Measured undefined = Measured::Undefined("points do not face any way");
    out.facing_recall.assign(config.thresholds_m.size(), undefined);
    out.facing_away = undefined;
    return;
  }
  const double reach_m = config.thresholds_m.back();
  const SampleMatch match =
      MatchSurface(truth.samples.points, truth.samples.normals, *our_triangles, reach_m);
  for (const double threshold : config.thresholds_m) {
    const auto found =
        std::count_if(match.agreeing_m.begin(), match.agreeing_m.end(),
                      [&](float distance) { return static_cast<double>(distance) <= threshold; });
    out.facing_recall.push_back(
        Measured::Of(static_cast<double>(found) / static_cast<double>(truth.samples.size())));
  }
  const NearestSurface nearest = true_triangles->Nearest(reconstruction.samples.points);
  std::size_t near = 0;
  std::size_t away = 0;
  for (std::size_t i = 0; i < reconstruction.samples.size(); ++i) {
    if (!(static_cast<double>(nearest.distance_m[i]) <= reach_m)) continue;
    ++near;
    if (nearest.normal[i].dot(reconstruction.samples.normals[i]) < 0.0F) ++away;
  }
  out.facing_away = near == 0 ? Measured::Undefined("nothing of it is within the largest threshold")
                              : Measured::Of(static_cast<double>(away) / static_cast<double>(near));
  if (out.facing_away.value && *out.facing_away.value > 0.5) {
    out.remarks.push_back(fmt::format(
        "{:.0f} % of what is near the truth faces the other way: are the faces of {} flipped? "
        "Distances do not ask, facing recall does",
        100 * *out.facing_away.value, reconstruction.name));
  }
}

Measured FloorOf(const Side& to) {
  return to.HasTriangles() ? Measured::Of(0) : SamplingFloor_m(to.mesh);
}

Measured FacetsOf(const Side& side) {
  return side.HasTriangles() ? TessellationFloor_m(side.mesh)
                             : Measured::Undefined("points, not a mesh");
}

EstimatorFloors FloorsOf(const Side& reconstruction, const Side& truth,
                         const SurfaceComparison& scores) {
  EstimatorFloors floors;
  floors.accuracy_m = FloorOf(truth);
  floors.completeness_m = FloorOf(reconstruction);
  floors.truth_facets_m = FacetsOf(truth);
  floors.reconstruction_facets_m = FacetsOf(reconstruction);
  floors.rounding_m = std::max(RoundingFloor_m(reconstruction.mesh), RoundingFloor_m(truth.mesh));
  floors.precision_error = 0.5 / std::sqrt(static_cast<double>(scores.accuracy.samples));
  floors.recall_error = 0.5 / std::sqrt(static_cast<double>(scores.completeness.samples));
  return floors;
}

}  // namespace

Expected<void> CheckUnits(const Eigen::AlignedBox3f& reconstruction,
                          const std::string& reconstruction_name, const Eigen::AlignedBox3f& truth,
                          const std::string& truth_name) {
  if (reconstruction.isEmpty() || truth.isEmpty()) return {};
  const double ours = static_cast<double>(reconstruction.sizes().maxCoeff());
  const double theirs = static_cast<double>(truth.sizes().maxCoeff());
  if (!(ours > 0 && theirs > 0)) return {};
  const double ratio = ours / theirs;
  if (ratio < kMostSizeRatio && ratio > 1 / kMostSizeRatio) return {};
  return DataError(
      "{}: measures {}, but {} {}: is it in another unit? Give its scale (--scale "
      "{:.3g} would fit, --scale 1 takes it as it is)",
      reconstruction_name, SizeText(reconstruction), truth_name, SizeText(truth),
      std::pow(10, -std::round(std::log10(ratio))));
}

Expected<SurfaceComparison> CompareSurfaces(const TriangleMesh& reconstruction_mesh,
                                            const std::string& reconstruction_name,
                                            const TriangleMesh& truth_mesh,
                                            const std::string& truth_name, bool scale_is_given,
                                            const SurfaceComparisonConfig& config) {
  TSDFPP_ASSIGN(const Side reconstruction,
                MakeSide(reconstruction_mesh, reconstruction_name, config, 0));
  TSDFPP_ASSIGN(const Side truth, MakeSide(truth_mesh, truth_name, config, 1));
  if (!scale_is_given)
    TSDFPP_RETURN_IF_ERROR(
        CheckUnits(reconstruction.box, reconstruction_name, truth.box, truth_name));

  // No query is farther from a surface than across both boxes.
  const double farthest_m =
      static_cast<double>(reconstruction.box.merged(truth.box).diagonal().norm());
  TSDFPP_ASSIGN(const SideIndex to_reconstruction, MakeIndex(reconstruction, farthest_m));
  TSDFPP_ASSIGN(const SideIndex to_truth, MakeIndex(truth, farthest_m));

  SurfaceComparison out;
  DirectedDistances* directed[2] = {&out.accuracy, &out.completeness};
  *directed[0] = Measure(reconstruction, truth, to_truth, config);
  *directed[1] = Measure(truth, reconstruction, to_reconstruction, config);
  Combine(out);
  ScoreFacing(reconstruction, to_reconstruction.triangles.get(), truth, to_truth.triangles.get(),
              config, out);
  RemarkOnOverlap(reconstruction, truth, config.thresholds_m.back(), out);
  out.floors = FloorsOf(reconstruction, truth, out);
  return out;
}

}  // namespace tsdfpp
