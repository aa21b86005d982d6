#include "metrics/statistics.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "core/random.h"

namespace tsdfpp {
namespace {

TEST(Normal, KnownValues) {
  EXPECT_DOUBLE_EQ(NormalCdf(0), 0.5);
  EXPECT_NEAR(NormalCdf(1.959963984540054), 0.975, 1e-15);
  EXPECT_NEAR(NormalCdf(-3), 0.0013498980316300933, 1e-17);
  EXPECT_NEAR(NormalQuantile(0.975), 1.959963984540054, 1e-14);
  EXPECT_NEAR(NormalQuantile(0.5), 0, 1e-15);
  EXPECT_NEAR(NormalQuantile(1e-6), -4.753424308822899, 1e-12);
  for (const double p : {0.001, 0.02, 0.3, 0.6, 0.99, 0.9999}) {
    EXPECT_NEAR(NormalCdf(NormalQuantile(p)), p, 1e-14);
  }
}

// numpy.percentile([1, 2, 4, 8], 100 q).
TEST(Quantile, InterpolatesAsNumpyDoes) {
  const std::array numbers = {1.0, 2.0, 4.0, 8.0};
  EXPECT_DOUBLE_EQ(QuantileOfSorted(numbers, 0), 1);
  EXPECT_DOUBLE_EQ(QuantileOfSorted(numbers, 0.25), 1.75);
  EXPECT_DOUBLE_EQ(QuantileOfSorted(numbers, 0.5), 3);
  EXPECT_DOUBLE_EQ(QuantileOfSorted(numbers, 0.9), 6.8);
  EXPECT_DOUBLE_EQ(QuantileOfSorted(numbers, 1), 8);
  EXPECT_DOUBLE_EQ(MedianOf(std::array{5.0, 1.0, 3.0}), 3);
}

// All 27 resamples of three values, each as likely: the mean's distribution is known exactly.
TEST(Bootstrap, ReplicatesHaveTheExactDistribution) {
  const std::array values = {0.0, 1.0, 5.0};
  std::vector<double> exact;
  for (const double a : values) {
    for (const double b : values) {
      for (const double c : values) exact.push_back((a + b + c) / 3);
    }
  }
  BootstrapConfig config;
  config.resamples = 27'000;
  const std::vector<double> replicates = BootstrapReplicates(values, MeanOf, config);
  for (const double level : {0.0, 1.0, 5.0 / 3, 2.0, 11.0 / 3, 5.0}) {
    const auto share = [&](const std::vector<double>& of) {
      return static_cast<double>(
                 std::count_if(of.begin(), of.end(), [&](double v) { return v <= level + 1e-9; })) /
             static_cast<double>(of.size());
    };
    // Four standard errors of a share of 27,000 draws.
    EXPECT_NEAR(share(replicates), share(exact), 4 * 0.5 / std::sqrt(27'000.0)) << level;
  }
}

TEST(Bootstrap, SeededAndFreeOfThreads) {
  std::vector<double> values;
  for (std::uint64_t i = 0; i < 50; ++i) values.push_back(GaussianDraw(3, 0, i)[0]);
  BootstrapConfig config;
  config.resamples = 2000;
  const auto all = BootstrapReplicates(values, MeanOf, config);
  {
    const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
    EXPECT_EQ(BootstrapReplicates(values, MeanOf, config), all);
  }
  // A longer run begins with the same replicates.
  config.resamples = 3000;
  const auto longer = BootstrapReplicates(values, MeanOf, config);
  EXPECT_TRUE(std::equal(all.begin(), all.end(), longer.begin()));
  config.seed = 2;
  EXPECT_NE(BootstrapReplicates(values, MeanOf, config)[0], all[0]);
  config.seed = 1;
  config.stream = 1;
  EXPECT_NE(BootstrapReplicates(values, MeanOf, config)[0], all[0]);
}

// The mean's jackknife has a closed form: a = sum (x - m)^3 / (6 (sum (x - m)^2)^1.5).
TEST(Bootstrap, BcaIsTheTextbooksFormula) {
  const std::vector<double> x = {0.1, 0.2, 0.3, 0.5, 0.9, 1.5, 2.2, 3.7, 5.1, 9.8};
  BootstrapConfig config;
  config.resamples = 20'000;
  std::vector<double> replicates = BootstrapReplicates(x, MeanOf, config);
  std::sort(replicates.begin(), replicates.end());
  const double mean = MeanOf(x);
  double squares = 0;
  double cubes = 0;
  for (const double value : x) {
    squares += std::pow(value - mean, 2);
    cubes += std::pow(value - mean, 3);
  }
  const double a = cubes / (6 * std::pow(squares, 1.5));
  const auto below = static_cast<double>(
      std::lower_bound(replicates.begin(), replicates.end(), mean) - replicates.begin());
  const auto at_most = static_cast<double>(
      std::upper_bound(replicates.begin(), replicates.end(), mean) - replicates.begin());
  const double z0 = NormalQuantile((below + at_most) / 2 / 20'000);
  const auto level = [&](double z) { return NormalCdf(z0 + (z0 + z) / (1 - a * (z0 + z))); };
  const auto interval = BootstrapInterval(x, MeanOf, config);
  ASSERT_TRUE(interval.value) << interval.why_not;
  EXPECT_NEAR(interval.value->low, QuantileOfSorted(replicates, level(-1.959963984540054)), 1e-9);
  EXPECT_NEAR(interval.value->high, QuantileOfSorted(replicates, level(1.959963984540054)), 1e-9);
  // Skewed to the right: BCa lies to the right of the percentiles.
  config.method = BootstrapConfig::Method::kPercentile;
  const auto percentile = BootstrapInterval(x, MeanOf, config);
  EXPECT_DOUBLE_EQ(percentile.value->low, QuantileOfSorted(replicates, 0.025));
  EXPECT_DOUBLE_EQ(percentile.value->high, QuantileOfSorted(replicates, 0.975));
  EXPECT_GT(interval.value->low, percentile.value->low + 0.05);
  EXPECT_GT(interval.value->high, percentile.value->high + 0.1);
}

// For the mean of many values both are the normal interval, m +- z s / sqrt(n).
TEST(Bootstrap, OfManyIsTheNormalInterval) {
  std::vector<double> values;
  for (std::uint64_t i = 0; i < 2000; ++i) values.push_back(3 + 2 * GaussianDraw(5, 1, i)[0]);
  const double mean = MeanOf(values);
  double squares = 0;
  for (const double value : values) squares += (value - mean) * (value - mean);
  const double standard_error = std::sqrt(squares) / 2000;
  for (const auto method : {BootstrapConfig::Method::kPercentile, BootstrapConfig::Method::kBca}) {
    BootstrapConfig config;
    config.method = method;
    config.resamples = 4000;
    config.confidence = 0.90;
    const auto interval = BootstrapInterval(values, MeanOf, config);
    // A quantile of 4000 replicates has a standard error of some 0.035 of theirs here.
    EXPECT_NEAR(interval.value->low, mean - 1.6449 * standard_error, 0.15 * standard_error);
    EXPECT_NEAR(interval.value->high, mean + 1.6449 * standard_error, 0.15 * standard_error);
  }
}

// An interval of 90 % holds the truth nine times in ten.
TEST(Bootstrap, CoversWhatItPromises) {
  int covered = 0;
  constexpr int kTrials = 400;
  for (int trial = 0; trial < kTrials; ++trial) {
    std::vector<double> values;
    for (std::uint64_t i = 0; i < 40; ++i) {
      values.push_back(GaussianDraw(11, static_cast<std::uint32_t>(trial), i)[0]);
    }
    BootstrapConfig config;
    config.confidence = 0.9;
    config.resamples = 500;
    config.seed = static_cast<std::uint64_t>(trial);
    const auto interval = BootstrapInterval(values, MeanOf, config);
    covered += interval.value->low <= 0 && 0 <= interval.value->high ? 1 : 0;
  }
  // The bootstrap's own shortfall at 40 values is some 1 %; three standard errors are 4.5 %.
  EXPECT_NEAR(covered / static_cast<double>(kTrials), 0.89, 0.045);
}

TEST(Bootstrap, WhatHasNoIntervalSaysWhy) {
  EXPECT_EQ(BootstrapInterval(std::array{1.0}, MeanOf, {}).why_not, "an interval needs two values");
  EXPECT_EQ(BootstrapInterval(std::array{2.0, 2.0, 2.0}, MeanOf, {}).why_not,
            "BCa needs spread, and all values are equal");
  BootstrapConfig percentile;
  percentile.method = BootstrapConfig::Method::kPercentile;
  const auto point = BootstrapInterval(std::array{2.0, 2.0, 2.0}, MeanOf, percentile);
  EXPECT_EQ(point.value->low, 2);
  EXPECT_EQ(point.value->high, 2);
  // The largest value: no replicate is above it.
  const Statistic largest = [](std::span<const double> v) {
    return *std::max_element(v.begin(), v.end());
  };
  const auto of_extreme = BootstrapInterval(std::array{1.0, 2.0, 3.0, 4.0}, largest, {});
  EXPECT_TRUE(of_extreme.value || !of_extreme.why_not.empty());
}

// ours - theirs = 1, 2, -3, 4, 0.
TEST(Paired, ClosedForms) {
  const std::array ours = {2.0, 4.0, 1.0, 9.0, 5.0};
  const std::array theirs = {1.0, 2.0, 4.0, 5.0, 5.0};
  const PairedComparison result = ComparePaired(ours, theirs);
  EXPECT_EQ(result.pairs, 5U);
  EXPECT_DOUBLE_EQ(*result.mean_difference.value, 0.8);
  EXPECT_DOUBLE_EQ(*result.median_difference.value, 1);
  // Squares about the mean: 0.04 + 1.44 + 14.44 + 10.24 + 0.64 = 26.8.
  const double dz = 0.8 / std::sqrt(26.8 / 4);
  EXPECT_NEAR(*result.cohens_dz.value, dz, 1e-15);
  EXPECT_NEAR(*result.hedges_gz.value, dz * (1 - 3.0 / 15), 1e-15);
  EXPECT_DOUBLE_EQ(*result.superiority.value, 3.5 / 5);
  // Ranks of 1, 2, 3, 4: positive 1 + 2 + 4, negative 3, of 10.
  EXPECT_DOUBLE_EQ(*result.rank_biserial.value, 0.4);
  EXPECT_TRUE(result.interval.value);
  const PairedComparison swapped = ComparePaired(theirs, ours);
  EXPECT_DOUBLE_EQ(*swapped.mean_difference.value, -0.8);
  EXPECT_DOUBLE_EQ(*swapped.rank_biserial.value, -0.4);
  EXPECT_DOUBLE_EQ(*swapped.superiority.value, 1.5 / 5);
}

// What varies from scene to scene alike cancels: the interval is the differences'.
TEST(Paired, TheSceneCancels) {
  std::vector<double> ours;
  std::vector<double> theirs;
  for (std::uint64_t i = 0; i < 30; ++i) {
    const auto draw = GaussianDraw(2, 7, i);
    theirs.push_back(10 * draw[0]);
    ours.push_back(theirs.back() + 0.5 + 0.1 * draw[1]);
  }
  const PairedComparison result = ComparePaired(ours, theirs);
  EXPECT_GT(result.interval.value->low, 0.4);
  EXPECT_LT(result.interval.value->high, 0.6);
}

TEST(Paired, TiedRanksShareTheirMean) {
  // |d| = 1, 1, 2: ranks 1.5, 1.5, 3.
  const PairedComparison result =
      ComparePaired(std::array{1.0, 0.0, 2.0}, std::array{0.0, 1.0, 0.0});
  EXPECT_DOUBLE_EQ(*result.rank_biserial.value, 3.0 / 6);
}

TEST(Paired, UndefinedSaysWhy) {
  const PairedComparison none = ComparePaired({}, {});
  EXPECT_EQ(none.mean_difference.why_not, "there are no pairs");
  EXPECT_FALSE(none.interval.value);
  const PairedComparison one = ComparePaired(std::array{2.0}, std::array{1.0});
  EXPECT_EQ(*one.mean_difference.value, 1);
  EXPECT_EQ(one.cohens_dz.why_not, "an effect size needs two pairs");
  const PairedComparison equal = ComparePaired(std::array{1.0, 2.0}, std::array{1.0, 2.0});
  EXPECT_EQ(equal.cohens_dz.why_not, "all differences are equal");
  EXPECT_EQ(equal.rank_biserial.why_not, "all differences are 0");
  EXPECT_DOUBLE_EQ(*equal.superiority.value, 0.5);
}

}  // namespace
}  // namespace tsdfpp
