// Reconstruction to truth: accuracy, precision, signed bias, label purity (docs/sources.md,
// "Accuracy").
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "metrics/measured.h"
#include "metrics/preservation.h"
#include "metrics/surface_samples.h"
#include "metrics/truth_surface.h"

namespace tsdfpp {

// How a reconstruction is sampled. The cost of an evaluation lies here, so the number is capped:
// the density falls until the cap holds.
struct ReconstructionSampling {
  double per_cm2 = 1;
  std::size_t max_samples = 50'000;
  std::uint64_t seed = 1;
};
SampleSet SampleReconstruction(const TriangleMesh& mesh_W, const ReconstructionSampling& sampling);

struct AccuracyScores {
  DistanceSummary distance;         // reconstruction to truth, by area
  Measured bias_m;                  // mean signed distance, positive outside the true surface
  std::vector<Measured> precision;  // share of the area within each threshold, in their order
  double area_m2 = 0;               // of the reconstruction that was scored
};

// Accuracy of an object's reconstructed faces (`samples_W`) against its own true surface at its
// true pose. With a region only those samples count whose nearest true triangle is in it. Normals
// are not asked for here: a sheet facing the wrong way at the right place counts as accurate, and
// is charged to completion.
AccuracyScores ScoreAccuracy(const SampleSet& samples_W, const PlacedTruth& truth,
                             std::optional<std::uint16_t> region,
                             std::span<const double> thresholds_m);

// Share of o's reconstructed area whose nearest true surface is o's. `truths` holds every object's
// surface, o's too. Where o's and another's surface are within `tie_m` of equally near (contact), o
// has it.
Measured ScoreLabelPurity(const SampleSet& samples_W, InstanceId object,
                          std::span<const PlacedTruth> truths, double tie_m = 1e-5);

}  // namespace tsdfpp
