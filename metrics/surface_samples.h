// Seeded, stratified, area-weighted samples of a surface.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/types.h"
#include "metrics/solid.h"

namespace tsdfpp {

// Parallel arrays, one entry a sample, in the frame of the mesh that was sampled.
struct SampleSet {
  std::vector<Eigen::Vector3f> points;
  std::vector<Eigen::Vector3f> normals;  // unit, outward
  std::vector<std::uint16_t> region;     // index into the model's regions
  std::vector<std::uint32_t> triangle;   // of the mesh
  std::vector<float> area_m2;            // the area that the sample stands for
  std::size_t size() const { return points.size(); }
};

// How densely a true model is sampled: at least 4 a cm^2 on the table and on objects
// (docs/sources.md, "Samples"); floor and walls are large and wait for nobody.
struct SampleConfig {
  double fine_per_cm2 = 4;
  double coarse_per_cm2 = 0.25;
  // The regions of the background that are sampled finely; all of an object is.
  std::vector<std::string> fine_background_regions = {"table"};
  std::uint64_t seed = 1;
};

// Samples a mesh evenly: it is cut (longest edge halved) into pieces of at most one sample's area,
// and sample i of n falls uniformly into the i-th n-th of the area along that order. So each sample
// stands for exactly area / n, and neighbours neither bunch up nor leave gaps. Triangles of no area
// get none. `stream` separates the random numbers of different surfaces.
//
// The floor of what these samples can tell: a distance is measured to triangles, so equal
// surfaces are 0 apart (single precision: under 1 um in a room), unlike a distance between point
// sets, whose floor is 0.5 / sqrt(density). A share p of n samples has a standard error of at most
// sqrt(p (1 - p) / n), in practice far less for connected patches (only those on its border
// are uncertain); a hole smaller than 1 / density may go unseen.
SampleSet SampleMesh(const TriangleMesh& mesh, double per_cm2, std::uint64_t seed,
                     std::uint32_t stream = 0);

// The same, region by region with the densities of `config`, at least one sample a region that has
// any area. The stream is the object's id.
SampleSet SampleModel(const TrueModel& model, const SampleConfig& config);

// Without the samples that lie inside the object: true models are unions of closed parts, so a
// part's faces go on inside another, where nobody can ever see them, yet a depth test with a margin
// takes those just under the surface for seen. A sample is inner where the point kInnerOffset_m
// along its normal is inside `solid`.
inline constexpr double kInnerOffset_m = 0.0005;
SampleSet WithoutInner(const SampleSet& samples, const Solid& solid);

// `points` (or, rotated only, `normals`) in another frame.
std::vector<Eigen::Vector3f> TransformPoints(const Pose& T_target_source,
                                             const std::vector<Eigen::Vector3f>& points);
std::vector<Eigen::Vector3f> TransformNormals(const Pose& T_target_source,
                                              const std::vector<Eigen::Vector3f>& normals);

}  // namespace tsdfpp
