#include "metrics/accuracy.h"

#include <algorithm>
#include <cmath>

#include "metrics/mesh_tools.h"

namespace tsdfpp {

SampleSet SampleReconstruction(const TriangleMesh& mesh_W, const ReconstructionSampling& sampling) {
  const double area_cm2 = 1e4 * SurfaceArea(mesh_W);
  if (!(area_cm2 > 0)) return {};
  const double cap = static_cast<double>(sampling.max_samples) / area_cm2;
  return SampleMesh(mesh_W, std::min(sampling.per_cm2, cap), sampling.seed);
}

AccuracyScores ScoreAccuracy(const SampleSet& samples_W, const PlacedTruth& truth,
                             std::optional<std::uint16_t> region,
                             std::span<const double> thresholds_m) {
  const std::vector<Eigen::Vector3f> points_O =
      TransformPoints(truth.T_WO.inverse(), samples_W.points);
  const NearestSurface nearest = truth.surface->index_O().Nearest(points_O);
  std::vector<float> distances;
  std::vector<float> weights;
  double total = 0;
  double signed_sum = 0;
  std::vector<double> within(thresholds_m.size(), 0);
  for (std::size_t i = 0; i < points_O.size(); ++i) {
    const std::uint32_t triangle = nearest.triangle[i];
    if (triangle == NearestSurface::kNone) continue;
    if (region && truth.surface->model().face_region[triangle] != *region) continue;
    const double weight = samples_W.area_m2[i];
    const double distance = nearest.distance_m[i];
    const bool outside = (points_O[i] - nearest.position[i]).dot(nearest.normal[i]) >= 0.0F;
    distances.push_back(nearest.distance_m[i]);
    weights.push_back(samples_W.area_m2[i]);
    total += weight;
    signed_sum += outside ? weight * distance : -weight * distance;
    for (std::size_t k = 0; k < within.size(); ++k) {
      if (distance <= thresholds_m[k]) within[k] += weight;
    }
  }
  const std::string why = "nothing of it is reconstructed";
  AccuracyScores scores;
  scores.area_m2 = total;
  scores.distance = SummariseDistances(distances, weights, why);
  scores.bias_m = total > 0 ? Measured::Of(signed_sum / total) : Measured::Undefined(why);
  for (const double part : within) {
    scores.precision.push_back(total > 0 ? Measured::Of(part / total) : Measured::Undefined(why));
  }
  return scores;
}

Measured ScoreLabelPurity(const SampleSet& samples_W, InstanceId object,
                          std::span<const PlacedTruth> truths, double tie_m) {
  std::vector<PlacedTruth> own;
  std::vector<PlacedTruth> others;
  for (const PlacedTruth& truth : truths) {
    (truth.surface->id() == object ? own : others).push_back(truth);
  }
  std::vector<float> limit_m = FindNearestTruth(samples_W.points, own).distance_m;
  for (float& limit : limit_m) limit -= static_cast<float>(tie_m);
  const NearestTruth others_nearer = FindNearestTruth(samples_W.points, others, limit_m);
  Selection pure(samples_W.size(), 0);
  for (std::size_t i = 0; i < pure.size(); ++i) {
    pure[i] = others_nearer.object[i] == kNoInstance && std::isfinite(limit_m[i]) ? 1 : 0;
  }
  return ShareOf(samples_W, SelectAll(samples_W), pure, "nothing of it is reconstructed");
}

}  // namespace tsdfpp
