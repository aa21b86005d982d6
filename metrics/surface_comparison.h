// A reconstruction against the truth, both as they are in files: meshes or points, no objects, no
// poses, nothing aligned. What `tsdfpp metric surface` prints.
#pragma once

#include <Eigen/Geometry>
#include <span>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/types.h"
#include "metrics/measured.h"

namespace tsdfpp {

// Here a TriangleMesh without triangles is a set of points.

struct SurfaceComparisonConfig {
  std::vector<double> thresholds_m = {0.005, 0.01, 0.02};  // increasing, one at least
  // How densely meshes are sampled; points are taken as they are. The density falls until a mesh
  // has at most `max_samples`.
  double samples_per_cm2 = 4;
  std::size_t max_samples = 1'000'000;
  std::uint64_t seed = 1;
};

// Distances from samples of one surface to another: to its triangles, exactly (single precision),
// where it has any, else to its points (double precision). All samples weigh the same, those of a
// mesh stand for the same area each. Metres.
struct DirectedDistances {
  std::size_t samples = 0;
  Measured samples_per_cm2;  // of a mesh
  bool to_triangles = false;
  double mean_m = 0;
  double median_m = 0;
  double rmse_m = 0;
  double p90_m = 0;  // percentiles interpolate between the samples, as numpy's do
  double p95_m = 0;
  double largest_m = 0;        // over the samples and, of a mesh, its vertices
  std::vector<double> within;  // share of the samples, at most each threshold away
};

// What equal surfaces would read, and so the least that a value can mean.
struct EstimatorFloors {
  Measured accuracy_m;      // to the truth: its points' spacing; 0 where it has triangles
  Measured completeness_m;  // to the reconstruction, the same
  Measured truth_facets_m;  // TessellationFloor_m, of meshes
  Measured reconstruction_facets_m;
  double rounding_m = 0;
  // A share of n samples has a standard error of at most 0.5 / sqrt(n).
  double precision_error = 0;
  double recall_error = 0;
};

struct SurfaceComparison {
  DirectedDistances accuracy;      // reconstruction to truth; `within` is the precision
  DirectedDistances completeness;  // truth to reconstruction; `within` is the recall
  std::vector<double> f_score;     // 2 P R / (P + R); 0 where both are
  double chamfer_sum_m = 0;        // sum of the two means
  double chamfer_mean_m = 0;       // half of it
  double chamfer_squared_m2 = 0;   // sum of the two means of squares
  // The larger of the two largest distances. Between meshes a lower bound of the true one, which
  // may lie between the samples.
  double hausdorff_m = 0;
  // Of meshes, else undefined: recall that also asks the surface to face within 60 deg of the way
  // the truth does (docs/sources.md, "Reconstructed samples"), and the share of the precise samples
  // (at the largest threshold) whose nearest true triangle faces away from theirs.
  std::vector<Measured> facing_recall;
  Measured facing_away;
  EstimatorFloors floors;
  std::vector<std::string> remarks;  // sentences on what looks wrong, though it has a value
};

// Errors: kData where the longest sides of two boxes, in metres, differ by a factor of 50 or more:
// a unit was mistaken, and the sentence proposes a scale. No error where a box has no side.
Expected<void> CheckUnits(const Eigen::AlignedBox3f& reconstruction,
                          const std::string& reconstruction_name, const Eigen::AlignedBox3f& truth,
                          const std::string& truth_name);

// Errors: kData, one sentence: a surface is empty, has no area, has a position that is not finite;
// or CheckUnits fails and `scale_is_given` is not set. `reconstruction_name` and `truth_name` are
// for sentences.
Expected<SurfaceComparison> CompareSurfaces(const TriangleMesh& reconstruction,
                                            const std::string& reconstruction_name,
                                            const TriangleMesh& truth,
                                            const std::string& truth_name, bool scale_is_given,
                                            const SurfaceComparisonConfig& config);

}  // namespace tsdfpp
