#include "metrics/trajectory.h"

#include <gtest/gtest.h>

#include <array>
#include <filesystem>

#include "core/units.h"
#include "metrics/association.h"
#include "tests/metrics/reference_files.h"

namespace tsdfpp {
namespace {

// evo keeps 17 digits; its quaternion arithmetic and ours differ in the last few.
constexpr double kEvoDigits = 1e-8;
constexpr double kEvoDegrees = 1e-6;

const char* const kTruthFile = "freiburg1_xyz-groundtruth.txt";

void ExpectSummary(const std::vector<double>& errors, double unit, const nlohmann::json& expected,
                   double tolerance, const std::string& what) {
  SCOPED_TRACE(what);
  const auto summary = SummariseErrors(errors);
  ASSERT_TRUE(summary);
  EXPECT_NEAR(summary->rmse * unit, expected["rmse"], tolerance);
  EXPECT_NEAR(summary->mean * unit, expected["mean"], tolerance);
  EXPECT_NEAR(summary->median * unit, expected["median"], tolerance);
  EXPECT_NEAR(summary->standard_deviation * unit, expected["std"], tolerance);
  EXPECT_NEAR(summary->smallest * unit, expected["min"], tolerance);
  EXPECT_NEAR(summary->largest * unit, expected["max"], tolerance);
  // A sum of up to 785 squares: relative.
  const double sse = expected["sse"];
  EXPECT_NEAR(summary->squares_sum * unit * unit, sse, tolerance * std::max(1.0, 100 * sse));
}

TEST(Trajectory, EqualsEvo) {
  const auto expected = testing::ReadJson(testing::EvoFile("expected_evo.json"));
  ASSERT_EQ(expected.size(), 3U);
  const StampedTrajectory truth = testing::ReadTum(testing::EvoFile(kTruthFile));
  for (const auto& [name, numbers] : expected.items()) {
    if (!std::filesystem::exists(testing::EvoFile(name))) continue;
    const Association association =
        AssociateByTime(truth, testing::ReadTum(testing::EvoFile(name)), numbers["t_max_diff"]);
    const PosePairs& pairs = association.pairs;
    ASSERT_EQ(pairs.size(), numbers["matched_pairs"].get<std::size_t>()) << name;
    for (const std::string kind : {"none", "se3", "sim3"}) {
      PosePairs aligned = pairs;
      if (kind != "none") {
        const auto alignment = AlignHorn(pairs, kind == "sim3");
        ASSERT_TRUE(alignment);
        EXPECT_TRUE(alignment->rotation_is_unique);
        const auto& transform = numbers["align_" + kind];
        EXPECT_NEAR(alignment->scale, transform["s"], kEvoDigits) << name;
        const Pose T = testing::PoseOf(transform["R"], transform["t"]);
        EXPECT_LT((alignment->R - T.linear()).norm(), kEvoDigits) << name;
        EXPECT_LT((alignment->t - T.translation()).norm(), kEvoDigits) << name;
        aligned = Aligned(pairs, *alignment);
      }
      ExpectSummary(TranslationErrors_m(aligned), 1, numbers["ape_trans_" + kind], kEvoDigits,
                    name + kind);
      ExpectSummary(RotationErrors_rad(aligned), kDegPerRad, numbers["ape_rot_deg_" + kind],
                    kEvoDegrees, name + kind);
      ExpectSummary(FullErrors(aligned), 1, numbers["ape_full_" + kind], kEvoDigits, name + kind);
    }
  }
  TSDFPP_NEEDS_SHARED("metric_refs/evo_tum");
}

TEST(Trajectory, EqualsTumTools) {
  const StampedTrajectory truth = testing::ReadTum(testing::EvoFile(kTruthFile));
  // rmse mean median std min max, as evaluate_ate.py prints them, within 0.02 s.
  struct Case {
    const char* name;
    std::size_t pairs;
    std::array<double, 6> printed;
  };
  for (const Case& expected :
       {Case{"rgbdslam", 786, {0.013473, 0.012029, 0.011176, 0.006068, 0.000939, 0.034727}},
        Case{"rgbdslam_drift", 786, {0.013473, 0.012029, 0.011176, 0.006068, 0.000939, 0.034728}},
        Case{"ORB_kf_mono", 32, {0.024302, 0.022598, 0.021091, 0.008938, 0.005640, 0.042735}}}) {
    SCOPED_TRACE(expected.name);
    const auto file = testing::EvoFile(std::string("freiburg1_xyz-") + expected.name + ".txt");
    if (!std::filesystem::exists(file)) continue;
    const PosePairs pairs = AssociateByTime(truth, testing::ReadTum(file), 0.02).pairs;
    ASSERT_EQ(pairs.size(), expected.pairs);
    const auto alignment = AlignHorn(pairs);
    ASSERT_TRUE(alignment);
    const auto summary = SummariseErrors(TranslationErrors_m(Aligned(pairs, *alignment)));
    constexpr double kPrinted = 5.01e-7;
    const auto& printed = expected.printed;
    EXPECT_NEAR(summary->rmse, printed[0], kPrinted);
    EXPECT_NEAR(summary->mean, printed[1], kPrinted);
    EXPECT_NEAR(summary->median, printed[2], kPrinted);
    EXPECT_NEAR(summary->standard_deviation, printed[3], kPrinted);
    EXPECT_NEAR(summary->smallest, printed[4], kPrinted);
    EXPECT_NEAR(summary->largest, printed[5], kPrinted);
  }
  TSDFPP_NEEDS_SHARED("metric_refs/evo_tum");
}

TEST(Trajectory, SummaryOfKnownNumbers) {
  const auto summary = SummariseErrors(std::array{1.0, 2.0, 3.0, 6.0});
  ASSERT_TRUE(summary);
  EXPECT_DOUBLE_EQ(summary->mean, 3);
  EXPECT_DOUBLE_EQ(summary->rmse, std::sqrt(12.5));
  EXPECT_DOUBLE_EQ(summary->median, 2.5);
  EXPECT_DOUBLE_EQ(summary->standard_deviation, std::sqrt(3.5));
  EXPECT_DOUBLE_EQ(summary->smallest, 1);
  EXPECT_DOUBLE_EQ(summary->largest, 6);
  EXPECT_DOUBLE_EQ(summary->squares_sum, 50);
  EXPECT_FALSE(SummariseErrors({}));
}

// One pose turned by 0.3 rad and moved by 5 cm.
TEST(Trajectory, ErrorsOfAKnownOffset) {
  const Pose truth(Eigen::Translation3d(1, 2, 3) *
                   Eigen::AngleAxisd(0.7, Eigen::Vector3d::UnitY()));
  const Pose estimate = truth * Pose(Eigen::Translation3d(0.03, 0, 0.04) *
                                     Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitX()));
  const PosePairs pairs = {{0}, {estimate}, {truth}};
  EXPECT_NEAR(TranslationErrors_m(pairs)[0], 0.05, 1e-12);
  EXPECT_NEAR(RotationErrors_rad(pairs)[0], 0.3, 1e-12);
  const auto both = PoseErrorsOf(pairs);
  ASSERT_TRUE(both);
  EXPECT_NEAR(both->translation_m.rmse, 0.05, 1e-12);
  EXPECT_NEAR(both->rotation_deg.rmse, 0.3 * 180 / std::numbers::pi, 1e-9);
  EXPECT_FALSE(PoseErrorsOf({}));
  // |R - I| of a turn by a is 2 sqrt(2) sin(a / 2).
  EXPECT_NEAR(FullErrors(pairs)[0], std::hypot(0.05, 2 * std::sqrt(2) * std::sin(0.15)), 1e-12);
}

PosePairs Circle(double angle_rad) {
  PosePairs pairs;
  for (int i = 0; i < 20; ++i) {
    pairs.frames.push_back(i);
    pairs.truth.emplace_back(Pose(Eigen::Translation3d(std::cos(0.2 * i), std::sin(0.2 * i), 0)));
    pairs.estimate.emplace_back(Pose(Eigen::AngleAxisd(angle_rad, Eigen::Vector3d::UnitZ())) *
                                pairs.truth.back());
  }
  return pairs;
}

TEST(Alignment, UndoesATurnAMoveAndAScale) {
  PosePairs pairs = Circle(0.4);
  for (Pose& pose : pairs.estimate) {
    pose.translation() = (0.25 * pose.translation() + Eigen::Vector3d(1, -2, 3)).eval();
  }
  const auto alignment = AlignHorn(pairs, true);
  ASSERT_TRUE(alignment);
  EXPECT_NEAR(alignment->scale, 4, 1e-12);
  EXPECT_NEAR(RotationAngle_rad(alignment->R), 0.4, 1e-12);
  for (const double error : TranslationErrors_m(Aligned(pairs, *alignment))) {
    EXPECT_NEAR(error, 0, 1e-12);
  }
  for (const double error : RotationErrors_rad(Aligned(pairs, *alignment))) {
    EXPECT_NEAR(error, 0, 1e-7);
  }
  EXPECT_DOUBLE_EQ(AlignHorn(pairs, false)->scale, 1);
}

TEST(Alignment, WhatHasNoneOrMoreThanOne) {
  PosePairs pairs = Circle(0);
  pairs.frames.resize(2);
  EXPECT_FALSE(AlignHorn(pairs)) << "two pairs";

  pairs = Circle(0);
  for (Pose& pose : pairs.estimate) pose.translation().setConstant(2);
  EXPECT_FALSE(AlignHorn(pairs)) << "an estimate on one point";
  EXPECT_FALSE(AlignHorn(pairs, true));

  pairs = Circle(0);
  for (Pose& pose : pairs.truth) pose.translation().setConstant(2);
  EXPECT_TRUE(AlignHorn(pairs)) << "moved onto the point, any turn will do";
  EXPECT_FALSE(AlignHorn(pairs)->rotation_is_unique);
  EXPECT_FALSE(AlignHorn(pairs, true)) << "scale 0";

  // On a line the translations fit, but not the rotations.
  pairs = Circle(0);
  for (Pose& pose : pairs.estimate) pose.translation().tail<2>().setZero();
  ASSERT_TRUE(AlignHorn(pairs));
  EXPECT_FALSE(AlignHorn(pairs)->rotation_is_unique);
  EXPECT_TRUE(AlignHorn(Circle(0))->rotation_is_unique);
}

StampedTrajectory AlongX(const std::vector<double>& stamps) {
  StampedTrajectory trajectory;
  for (const double stamp : stamps) {
    trajectory.emplace(stamp, Pose(Eigen::Translation3d(stamp, 0, 0)));
  }
  return trajectory;
}

TEST(Association, NearestOfTheLongerWithinTheTolerance) {
  const StampedTrajectory truth = AlongX({0, 1, 2, 3, 4, 5});
  const StampedTrajectory estimate = AlongX({0.1, 1.45, 2.6, 9});
  const Association found = AssociateByTime(truth, estimate, 0.4);
  ASSERT_EQ(found.pairs.size(), 2U);
  EXPECT_EQ(found.pairs.frames, (std::vector<int>{0, 2}));
  EXPECT_EQ(found.stamps_s, (std::vector<double>{0.1, 2.6}));
  EXPECT_EQ(found.pairs.truth[1].translation().x(), 3);
  EXPECT_EQ(found.pairs.estimate[1].translation().x(), 2.6);
  EXPECT_EQ(found.unmatched_estimate, 2U);
  EXPECT_EQ(found.unmatched_truth, 4U);
  // The other way round, the truth being the shorter: the same pairs with the sides changed.
  const Association turned = AssociateByTime(estimate, truth, 0.4);
  EXPECT_EQ(turned.stamps_s, (std::vector<double>{0, 3}));
  EXPECT_EQ(turned.pairs.frames, (std::vector<int>{0, 3}));
  EXPECT_EQ(turned.pairs.truth[1].translation().x(), 2.6);
  EXPECT_EQ(turned.unmatched_truth, 2U);
  EXPECT_EQ(turned.unmatched_estimate, 4U);
  // Exactly at the tolerance is within it; of two equally near the earlier.
  const Association tied = AssociateByTime(AlongX({1, 2}), AlongX({1.5}), 0.5);
  ASSERT_EQ(tied.pairs.size(), 1U);
  EXPECT_EQ(tied.pairs.truth[0].translation().x(), 1);
  EXPECT_EQ(AssociateByTime({}, estimate, 1).pairs.size(), 0U);
  EXPECT_EQ(AssociateByTime(truth, {}, 1).unmatched_truth, 6U);
}

// A circle driven at 1 deg a frame.
Pose CarAt(int frame) {
  const double angle = frame / kDegPerRad;
  return Pose(Eigen::Translation3d(std::cos(angle), std::sin(angle), 0) *
              Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitZ()));
}

TEST(ObjectTrajectory, AFrameOfTheMappersChoiceIsNoError) {
  const Pose T_OE(Eigen::Translation3d(0.3, -0.2, 0.5) *
                  Eigen::AngleAxisd(0.8, Eigen::Vector3d(1, 2, 3).normalized()));
  Trajectory truth;
  Trajectory estimate;
  for (int frame = 1; frame <= 90; ++frame) truth[frame] = CarAt(frame);
  for (int frame = 11; frame <= 90; ++frame) estimate[frame] = CarAt(frame) * T_OE;
  const auto scores = ScoreObjectTrajectory(estimate, truth, Pose::Identity(), Pose::Identity());
  EXPECT_EQ(scores.frames, 80U);
  EXPECT_NEAR(*scores.ate_rmse_m.value, 0, 1e-12);
  EXPECT_NEAR(*scores.rotation_rmse_deg.value, 0, 1e-6);
  EXPECT_NEAR(*scores.cofusion_rmse_m.value, 0, 1e-12);
  EXPECT_NEAR(*scores.rpe_rmse_m.value, 0, 1e-12);
  EXPECT_NEAR(*scores.rpe_rmse_deg.value, 0, 1e-6);
}

// An estimate that stays at the first pose: no later alignment may soften it.
TEST(ObjectTrajectory, ADeadTrackerIsOffByTheWholeWay) {
  Trajectory truth;
  Trajectory estimate;
  double squares = 0;
  double angles = 0;
  for (int frame = 0; frame <= 90; ++frame) {
    truth[frame] = CarAt(frame);
    estimate[frame] = CarAt(0);
    squares += std::pow(2 * std::sin(frame / kDegPerRad / 2), 2);
    angles += frame * frame;
  }
  const auto scores = ScoreObjectTrajectory(estimate, truth, Pose::Identity(), Pose::Identity());
  EXPECT_NEAR(*scores.ate_rmse_m.value, std::sqrt(squares / 91), 1e-12);
  EXPECT_NEAR(*scores.rotation_rmse_deg.value, std::sqrt(angles / 91), 1e-9);
  EXPECT_NEAR(*scores.rpe_rmse_deg.value, 1, 1e-9);
  EXPECT_NEAR(*scores.rpe_rmse_m.value, 2 * std::sin(0.5 / kDegPerRad), 1e-12);
  EXPECT_FALSE(scores.cofusion_rmse_m.value) << "a point has no orientation to align";
}

// A camera whose world is turned and moved: the Co-Fusion protocol takes that out.
TEST(ObjectTrajectory, CoFusionProtocolIsFreeOfTheWorldsFrame) {
  const Pose T_VW(Eigen::Translation3d(4, 5, 6) * Eigen::AngleAxisd(1, Eigen::Vector3d::UnitX()));
  const Pose T_WC(Eigen::Translation3d(0, 0, 2) * Eigen::AngleAxisd(3, Eigen::Vector3d::UnitX()));
  Trajectory truth;
  Trajectory estimate;
  for (int frame = 0; frame <= 90; ++frame) {
    truth[frame] = CarAt(frame);
    estimate[frame] = T_VW * CarAt(frame);
  }
  const auto scores = ScoreObjectTrajectory(estimate, truth, T_VW * T_WC, T_WC);
  EXPECT_NEAR(*scores.cofusion_rmse_m.value, 0, 1e-9);
}

TEST(ObjectTrajectory, UntrackedIsUndefined) {
  const auto scores =
      ScoreObjectTrajectory({}, {{1, Pose::Identity()}}, Pose::Identity(), Pose::Identity());
  EXPECT_FALSE(scores.ate_rmse_m.value);
  EXPECT_EQ(scores.ate_rmse_m.why_not, "the object was never tracked");
  EXPECT_FALSE(scores.cofusion_rmse_m.value);
  EXPECT_FALSE(scores.rpe_rmse_m.value);
}

}  // namespace
}  // namespace tsdfpp
