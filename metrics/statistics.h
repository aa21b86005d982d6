// Is a difference between two methods more than chance? Paired bootstrap intervals, effect sizes.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "metrics/measured.h"

namespace tsdfpp {

// Standard normal distribution: P(Z <= z), and its inverse for 0 < p < 1 (both to some 1e-15).
double NormalCdf(double z);
double NormalQuantile(double p);

struct Interval {
  double low = 0;
  double high = 0;
};
struct MeasuredInterval {
  std::optional<Interval> value;
  std::string why_not;
};

struct BootstrapConfig {
  // kPercentile: the quantiles of the replicates (Efron 1979), interpolated as numpy does.
  // kBca: bias-corrected and accelerated (Efron 1987), the acceleration by the jackknife; as
  // scipy.stats.bootstrap(method="BCa") computes it. Better where the statistic is skewed, but it
  // needs some spread, and for fewer than some ten values neither covers what it promises.
  enum class Method { kPercentile, kBca };
  Method method = Method::kBca;
  double confidence = 0.95;  // in (0, 1)
  int resamples = 10'000;    // at least 1
  std::uint64_t seed = 1;
  std::uint32_t stream = 0;
};

using Statistic = std::function<double(std::span<const double>)>;
double MeanOf(std::span<const double> values);    // not of nothing
double MedianOf(std::span<const double> values);  // the mean of the two middle ones; not of nothing

// Value below which the share `q` (0..1) of the numbers lies, interpolated between neighbours as
// numpy.percentile does; `numbers` is sorted and not empty.
double QuantileOfSorted(std::span<const double> numbers, double q);

// The statistic of each resample, in order: value k of resample r is drawn by Philox for (seed,
// stream, r, k), so any replicate can be made again alone and the threads change nothing.
std::vector<double> BootstrapReplicates(std::span<const double> values, const Statistic& statistic,
                                        const BootstrapConfig& config);

// Confidence interval of the statistic over `values`, which are independent draws (scenes, seeds;
// *not* the frames of one sequence, which resemble each other). Undefined, with the reason, for
// fewer than two values, and for BCa where all values or all replicates are equal.
MeasuredInterval BootstrapInterval(std::span<const double> values, const Statistic& statistic,
                                   const BootstrapConfig& config);

// What paired runs (both methods on the same frames and seeds) say of `ours` - `theirs`.
struct PairedComparison {
  std::size_t pairs = 0;
  Measured mean_difference;
  MeasuredInterval interval;  // of the mean difference
  Measured median_difference;
  // Cohen's d for pairs: mean difference over its standard deviation (n - 1). No unit.
  Measured cohens_dz;
  // The same with Hedges' correction for few pairs, times 1 - 3 / (4 (n - 1) - 1).
  Measured hedges_gz;
  // Share of the pairs in which ours is larger, ties counting half; 0..1.
  Measured superiority;
  // Matched-pairs rank-biserial correlation (Kerby 2014): of the ranks of the differences' sizes
  // (ties share their mean rank, zeros are left out), the share that is positive minus the share
  // that is negative; -1..1.
  Measured rank_biserial;
};
// `ours` and `theirs` are of one length (a programmer's duty), entry by entry from the same input.
// The interval resamples the differences, never the two sides apart.
PairedComparison ComparePaired(std::span<const double> ours, std::span<const double> theirs,
                               const BootstrapConfig& config = {});

}  // namespace tsdfpp
