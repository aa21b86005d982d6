#include "metrics/statistics.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <numeric>

#include "core/random.h"

namespace tsdfpp {
namespace {

// Rational approximation of the normal quantile (P. J. Acklam), to 1.2e-9 of the value.
double RoughNormalQuantile(double p) {
  constexpr std::array a{-3.969683028665376e+01, 2.209460984245205e+02,  -2.759285104469687e+02,
                         1.383577518672690e+02,  -3.066479806614716e+01, 2.506628277459239e+00};
  constexpr std::array b{-5.447609879822406e+01, 1.615858368580409e+02, -1.556989798598866e+02,
                         6.680131188771972e+01, -1.328068155288572e+01};
  constexpr std::array c{-7.784894002430293e-03, -3.223964580411365e-01, -2.400758277161838e+00,
                         -2.549732539343734e+00, 4.374664141464968e+00,  2.938163982698783e+00};
  constexpr std::array d{7.784695709041462e-03, 3.224671290700398e-01, 2.445134137142996e+00,
                         3.754408661907416e+00};
  constexpr double kTail = 0.02425;
  if (p > 0.5) return -RoughNormalQuantile(1 - p);
  if (p < kTail) {
    const double q = std::sqrt(-2 * std::log(p));
    return (((((c[0] * q + c[1]) * q + c[2]) * q + c[3]) * q + c[4]) * q + c[5]) /
           ((((d[0] * q + d[1]) * q + d[2]) * q + d[3]) * q + 1);
  }
  const double q = p - 0.5;
  const double r = q * q;
  return (((((a[0] * r + a[1]) * r + a[2]) * r + a[3]) * r + a[4]) * r + a[5]) * q /
         (((((b[0] * r + b[1]) * r + b[2]) * r + b[3]) * r + b[4]) * r + 1);
}

// Draw k of resample r: an index in [0, count).
class IndexDraws {
 public:
  IndexDraws(const BootstrapConfig& config, std::size_t count) : config_(config), count_(count) {}

  void Resample(std::uint64_t resample, std::span<const double> values,
                std::vector<double>& out) const {
    std::array<double, 4> draw{};
    for (std::size_t k = 0; k < count_; ++k) {
      if (k % 4 == 0) {
        draw =
            UniformDraw(config_.seed, config_.stream, resample, static_cast<std::uint32_t>(k / 4));
      }
      out[k] = values[static_cast<std::size_t>(draw[k % 4] * static_cast<double>(count_))];
    }
  }

 private:
  const BootstrapConfig& config_;
  std::size_t count_;
};

// The share of the replicates at which BCa reads the bound that a normal statistic has at `p`;
// nothing where it is not defined.
struct BcaLevels {
  double bias = 0;          // z0
  double acceleration = 0;  // a

  double At(double p) const {
    const double z = bias + NormalQuantile(p);
    return NormalCdf(bias + z / (1 - acceleration * z));
  }
};

// Of the jackknife's values, sum of cubes over 6 (sum of squares)^1.5.
double Acceleration(std::span<const double> values, const Statistic& statistic) {
  std::vector<double> without;
  std::vector<double> left_out(values.size());
  for (std::size_t i = 0; i < values.size(); ++i) {
    without.assign(values.begin(), values.end());
    without.erase(without.begin() + static_cast<std::ptrdiff_t>(i));
    left_out[i] = statistic(without);
  }
  const double mean = MeanOf(left_out);
  double squares = 0;
  double cubes = 0;
  for (const double value : left_out) {
    const double below = mean - value;
    squares += below * below;
    cubes += below * below * below;
  }
  return cubes / (6 * std::pow(squares, 1.5));
}

MeasuredInterval Undefined(std::string why) { return {std::nullopt, std::move(why)}; }

Measured RankBiserial(const std::vector<double>& differences) {
  std::vector<double> sizes;
  for (const double difference : differences) {
    if (difference != 0) sizes.push_back(std::abs(difference));
  }
  if (sizes.empty()) return Measured::Undefined("all differences are 0");
  std::sort(sizes.begin(), sizes.end());
  double balance = 0;
  for (const double difference : differences) {
    if (difference == 0) continue;
    const auto [first, last] = std::equal_range(sizes.begin(), sizes.end(), std::abs(difference));
    const auto rank =
        0.5 * static_cast<double>((first - sizes.begin()) + (last - sizes.begin()) + 1);
    balance += difference > 0 ? rank : -rank;
  }
  const auto count = static_cast<double>(sizes.size());
  return Measured::Of(balance / (0.5 * count * (count + 1)));
}

}  // namespace

double NormalCdf(double z) { return 0.5 * std::erfc(-z / std::numbers::sqrt2); }

double NormalQuantile(double p) {
  const double rough = RoughNormalQuantile(p);
  // One step of Halley's method.
  const double density = std::exp(-0.5 * rough * rough) / std::sqrt(2 * std::numbers::pi);
  const double step = (NormalCdf(rough) - p) / density;
  return rough - step / (1 + 0.5 * rough * step);
}

double MeanOf(std::span<const double> values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

double MedianOf(std::span<const double> values) {
  std::vector<double> sorted(values.begin(), values.end());
  std::sort(sorted.begin(), sorted.end());
  return QuantileOfSorted(sorted, 0.5);
}

double QuantileOfSorted(std::span<const double> numbers, double q) {
  const double place = q * static_cast<double>(numbers.size() - 1);
  const auto below = static_cast<std::size_t>(place);
  const std::size_t above = std::min(below + 1, numbers.size() - 1);
  const double share = place - static_cast<double>(below);
  return numbers[below] + share * (numbers[above] - numbers[below]);
}

std::vector<double> BootstrapReplicates(std::span<const double> values, const Statistic& statistic,
                                        const BootstrapConfig& config) {
  std::vector<double> replicates(static_cast<std::size_t>(config.resamples));
  const IndexDraws draws(config, values.size());
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, replicates.size(), 256),
                    [&](const auto& range) {
                      std::vector<double> resample(values.size());
                      for (std::size_t r = range.begin(); r < range.end(); ++r) {
                        draws.Resample(r, values, resample);
                        replicates[r] = statistic(resample);
                      }
                    });
  return replicates;
}

MeasuredInterval BootstrapInterval(std::span<const double> values, const Statistic& statistic,
                                   const BootstrapConfig& config) {
  if (values.size() < 2) return Undefined("an interval needs two values");
  std::vector<double> replicates = BootstrapReplicates(values, statistic, config);
  std::sort(replicates.begin(), replicates.end());
  double low = 0.5 * (1 - config.confidence);
  double high = 0.5 * (1 + config.confidence);
  if (config.method == BootstrapConfig::Method::kBca) {
    if (std::all_of(values.begin(), values.end(), [&](double v) { return v == values[0]; })) {
      return Undefined("BCa needs spread, and all values are equal");
    }
    const double observed = statistic(values);
    const auto [first, last] = std::equal_range(replicates.begin(), replicates.end(), observed);
    const double below =
        0.5 * static_cast<double>((first - replicates.begin()) + (last - replicates.begin())) /
        static_cast<double>(replicates.size());
    const BcaLevels levels{NormalQuantile(below), Acceleration(values, statistic)};
    if (!(below > 0 && below < 1) || !std::isfinite(levels.acceleration)) {
      return Undefined(
          "BCa needs replicates on both sides of the statistic, and a jackknife that "
          "has spread");
    }
    low = levels.At(low);
    high = levels.At(high);
  }
  return {Interval{QuantileOfSorted(replicates, low), QuantileOfSorted(replicates, high)}, {}};
}

PairedComparison ComparePaired(std::span<const double> ours, std::span<const double> theirs,
                               const BootstrapConfig& config) {
  PairedComparison result;
  result.pairs = ours.size();
  std::vector<double> differences(ours.size());
  double larger = 0;
  for (std::size_t i = 0; i < ours.size(); ++i) {
    differences[i] = ours[i] - theirs[i];
    larger += differences[i] > 0 ? 1 : differences[i] == 0 ? 0.5 : 0;
  }
  if (differences.empty()) {
    const Measured none = Measured::Undefined("there are no pairs");
    result.mean_difference = result.median_difference = result.superiority = none;
    result.rank_biserial = result.cohens_dz = result.hedges_gz = none;
    result.interval = Undefined(none.why_not);
    return result;
  }
  const auto count = static_cast<double>(differences.size());
  const double mean = MeanOf(differences);
  result.mean_difference = Measured::Of(mean);
  result.median_difference = Measured::Of(MedianOf(differences));
  result.superiority = Measured::Of(larger / count);
  result.rank_biserial = RankBiserial(differences);
  result.interval = BootstrapInterval(differences, MeanOf, config);
  double squares = 0;
  for (const double difference : differences) squares += (difference - mean) * (difference - mean);
  if (differences.size() < 2 || !(squares > 0)) {
    result.cohens_dz = result.hedges_gz = Measured::Undefined(
        differences.size() < 2 ? "an effect size needs two pairs" : "all differences are equal");
    return result;
  }
  const double dz = mean / std::sqrt(squares / (count - 1));
  result.cohens_dz = Measured::Of(dz);
  result.hedges_gz = Measured::Of(dz * (1 - 3 / (4 * (count - 1) - 1)));
  return result;
}

}  // namespace tsdfpp
