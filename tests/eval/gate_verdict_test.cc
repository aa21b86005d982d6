#include "eval/gate/gate_verdict.h"

#include <gtest/gtest.h>

#include "core/random.h"

namespace tsdfpp {
namespace {

const BootstrapConfig kPlain{BootstrapConfig::Method::kPercentile, 0.95, 2000, 1, 0};

Verdict Of(const std::vector<double>& values, const Bounds& bounds, double confidence = 0.9) {
  return Judge(values, bounds, confidence, kPlain).verdict;
}

TEST(GateVerdict, TheIntervalDecides) {
  const std::vector<double> values{0.4, 0.5, 0.6, 0.5};  // all intervals lie in [0.4, 0.6]
  EXPECT_EQ(Of(values, {0.3, {}}), Verdict::kPass);
  EXPECT_EQ(Of(values, {{}, 0.7}), Verdict::kPass);
  EXPECT_EQ(Of(values, {0.3, 0.7}), Verdict::kPass);
  EXPECT_EQ(Of(values, {0.7, {}}), Verdict::kFail);
  EXPECT_EQ(Of(values, {{}, 0.3}), Verdict::kFail);
  EXPECT_EQ(Of(values, {0.7, 0.9}), Verdict::kFail);
  EXPECT_EQ(Of(values, {0.5, {}}), Verdict::kInconclusive);
  EXPECT_EQ(Of(values, {{}, 0.5}), Verdict::kInconclusive);
  EXPECT_EQ(Of(values, {0.499, 0.501}), Verdict::kInconclusive) << "wider than the bounds";
}

TEST(GateVerdict, BoundsAreIncluded) {
  EXPECT_EQ(Of({0.5, 0.5}, {0.5, 0.5}), Verdict::kPass);
  EXPECT_EQ(Of({0.5, 0.5}, {0.5000001, {}}), Verdict::kFail);
  EXPECT_EQ(Of({0.5}, {0.5, 0.5}, kEveryOne), Verdict::kPass);
}

// One bad seed among good ones: the mean may hold, every one does not.
TEST(GateVerdict, EveryOneLooksAtTheWorst) {
  const std::vector<double> values{0.9, 0.9, 0.9, 0.9, 0.9, 0.9, 0.9, 0.1};
  EXPECT_EQ(Of(values, {0.2, {}}, kEveryOne), Verdict::kFail);
  EXPECT_EQ(Of(values, {0.2, {}}), Verdict::kPass);
  EXPECT_EQ(Of(values, {0.1, {}}, kEveryOne), Verdict::kPass);
}

TEST(GateVerdict, WhatCannotBeJudgedIsInvalid) {
  EXPECT_EQ(Of({}, {0.2, {}}), Verdict::kInvalid);
  EXPECT_EQ(Of({}, {0.2, {}}, kEveryOne), Verdict::kInvalid);
  const Judgement one = Judge(std::vector<double>{0.5}, {0.2, {}}, 0.95, kPlain);
  EXPECT_EQ(one.verdict, Verdict::kInvalid);
  EXPECT_NE(one.why.find("no interval"), std::string::npos) << one.why;
}

// A gate that asks for more confidence must not pass where one that asks for less does not.
TEST(GateVerdict, MoreConfidenceNeverTurnsIntoAPass) {
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    std::vector<double> values;
    for (std::uint64_t i = 0; i < 6; ++i) values.push_back(GaussianDraw(seed, 0, i, 0)[0]);
    for (const double low : {-1.0, -0.5, 0.0, 0.5}) {
      const Verdict sure = Of(values, {low, {}}, 0.99);
      const Verdict less_sure = Of(values, {low, {}}, 0.6);
      if (sure != Verdict::kInconclusive) {
        EXPECT_EQ(sure, less_sure) << seed << " " << low;
      }
    }
  }
}

TEST(GateVerdict, TheSmallestRegressionIsWhereTheVerdictTurns) {
  const std::vector<double> values{0.94, 0.95, 0.97, 0.95};
  const Bounds bounds{0.9, 1.05};
  constexpr double kBeside = 1e-9;
  for (const double confidence : {0.9, kEveryOne}) {
    const Judgement judgement = Judge(values, bounds, confidence, kPlain);
    const Detects detects = SmallestDetected(judgement, bounds, confidence);
    ASSERT_TRUE(detects.fall && detects.rise);
    const auto shifted = [&](double by) {
      std::vector<double> moved = values;
      for (double& value : moved) value += by;
      return Of(moved, bounds, confidence);
    };
    EXPECT_EQ(shifted(-*detects.fall - kBeside), Verdict::kFail);
    EXPECT_NE(shifted(-*detects.fall + kBeside), Verdict::kFail);
    EXPECT_EQ(shifted(*detects.rise + kBeside), Verdict::kFail);
    EXPECT_NE(shifted(*detects.rise - kBeside), Verdict::kFail);
  }
  const Judgement one_sided = Judge(values, {0.9, {}}, 0.9, kPlain);
  EXPECT_FALSE(SmallestDetected(one_sided, {0.9, {}}, 0.9).rise);
}

TEST(GateVerdict, ExitCodes) {
  using V = Verdict;
  EXPECT_EQ(ExitCodeOf(std::vector<V>{V::kPass, V::kPass}), 0);
  EXPECT_EQ(ExitCodeOf(std::vector<V>{V::kPass, V::kFail, V::kInvalid}), 1);
  EXPECT_EQ(ExitCodeOf(std::vector<V>{V::kPass, V::kInconclusive}), 4);
  EXPECT_EQ(ExitCodeOf(std::vector<V>{V::kInvalid}), 4);
  EXPECT_EQ(ExitCodeOf({}), 4) << "no gate at all proves nothing";
}

TEST(GateVerdict, Agreement) {
  const auto verdict = [](const std::vector<double>& values) {
    return JudgeAgreement(values, 0.02, {0.9, {}}).verdict;
  };
  EXPECT_EQ(verdict({0.95, 0.96, 0.965}), Verdict::kPass);
  EXPECT_EQ(verdict({0.95, 0.96, 0.98}), Verdict::kFail) << "they differ";
  EXPECT_EQ(verdict({0.5, 0.5}), Verdict::kFail) << "they agree on something wrong";
  EXPECT_EQ(verdict({0.95}), Verdict::kInvalid);
}

}  // namespace
}  // namespace tsdfpp
