// Whether places go one way: against t by the textbook, and by draws.
#include "mapper/track/trend.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "core/random.h"

namespace tsdfpp {
namespace {

constexpr double kWeakShare = 0.02;

KnownDirections AllKnown() {
  KnownDirections known;
  known.shift_shares = known.turn_shares = Eigen::Vector3d(0.3, 0.3, 0.4);
  return known;
}

std::vector<Vector6> Along(Eigen::Index axis, const std::vector<double>& values) {
  std::vector<Vector6> places;
  for (const double value : values) {
    places.emplace_back(Vector6::Zero());
    places.back()[axis] = value;
  }
  return places;
}

TEST(Trend, IsTheSlopeOverItsError) {
  // Of 1, 2, 4, 5, 8 over -2 .. 2: slope 1.7, what is left -0.4 .. with the squares 1.1, so that
  // the error is sqrt(1.1 / 3 / 10).
  const double expected = 1.7 / std::sqrt(1.1 / 30);
  for (Eigen::Index axis = 0; axis < 6; ++axis) {
    EXPECT_NEAR(TrendOf(Along(axis, {1, 2, 4, 5, 8}), AllKnown(), kWeakShare, 0), expected, 1e-9);
    EXPECT_NEAR(TrendOf(Along(axis, {-1, -2, -4, -5, -8}), AllKnown(), kWeakShare, 0), expected,
                1e-9);
  }
}

TEST(Trend, LeavesOutWhatSaysNothing) {
  const std::vector<double> going{0, 1, 2.1, 2.9, 4};
  KnownDirections known = AllKnown();
  EXPECT_GT(TrendOf(Along(5, going), known, kWeakShare, 0), 10);
  known.turn_shares[2] = kWeakShare / 2;
  EXPECT_EQ(TrendOf(Along(5, going), known, kWeakShare, 0), 0) << "a turn that nothing knows";
  known.shift_shares[0] = kWeakShare / 2;
  EXPECT_GT(TrendOf(Along(0, going), known, kWeakShare, 0), 10) << "a shift counts all the same";
  EXPECT_GT(TrendOf(Along(0, going), known, kWeakShare, 3.9), 10);
  EXPECT_EQ(TrendOf(Along(0, going), known, kWeakShare, 4.1), 0) << "less far than asked";
  EXPECT_EQ(TrendOf(Along(0, {0, 1}), known, kWeakShare, 0), 0) << "a line through two";
  EXPECT_EQ(TrendOf(Along(0, {2, 2, 2, 2}), known, kWeakShare, 0.01), 0);
  EXPECT_EQ(TrendOf(Along(0, {0, 1, 2, 3}), known, kWeakShare, 0),
            std::numeric_limits<double>::infinity());
  EXPECT_EQ(TrendOf(Along(0, {0, std::nan(""), 2, 3}), known, kWeakShare, 0), 0);
}

// The directions are those of `known`, not the axes.
TEST(Trend, TurnsWithTheDirections) {
  KnownDirections known = AllKnown();
  known.turns = Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, -1).normalized()).matrix();
  known.turn_shares = {0, 0, 1};
  std::vector<Vector6> places;
  for (const double value : {0.0, 1.0, 2.1, 2.9, 4.0}) {
    places.emplace_back(Vector6::Zero());
    places.back().tail<3>() = value * known.turns.col(2);
  }
  const double along = TrendOf(places, known, kWeakShare, 0);
  EXPECT_NEAR(along, TrendOf(Along(0, {0, 1, 2.1, 2.9, 4}), known, kWeakShare, 0), 1e-9);
  for (Vector6& place : places) place.tail<3>() = place.tail<3>().norm() * known.turns.col(0);
  EXPECT_LT(TrendOf(places, known, kWeakShare, 1e-9), 1e-9) << "of which nothing is known";
}

// Of what stands still and is found beside its place by noise; of what goes by as much a frame.
TEST(Trend, TellsNoiseFromAWay) {
  constexpr int kDraws = 2000;
  constexpr double kSure = 5;  // a two-sided chance of 0.015 for each of six, with three degrees
  int false_ways = 0;
  int true_ways = 0;
  for (std::uint64_t draw = 0; draw < kDraws; ++draw) {
    std::vector<Vector6> still(5, Vector6::Zero());
    for (std::uint64_t k = 0; k < 5; ++k) {
      for (std::uint64_t axis = 0; axis < 6; ++axis) {
        still[k][static_cast<Eigen::Index>(axis)] = GaussianDraw(7, 1, draw, 6 * k + axis)[0];
      }
    }
    std::vector<Vector6> going = still;
    for (std::size_t k = 0; k < 5; ++k) going[k][1] += 3 * static_cast<double>(k);
    false_ways += TrendOf(still, AllKnown(), kWeakShare, 0) > kSure ? 1 : 0;
    true_ways += TrendOf(going, AllKnown(), kWeakShare, 0) > kSure ? 1 : 0;
  }
  // 0.0154 for one, so 0.089 for six.
  EXPECT_NEAR(false_ways / double(kDraws), 0.089, 0.025);
  EXPECT_GT(true_ways, 0.85 * kDraws);
}

}  // namespace
}  // namespace tsdfpp
