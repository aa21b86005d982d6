#include "metrics/relative_error.h"

#include <gtest/gtest.h>

#include <array>

#include "core/units.h"
#include "metrics/trajectory_report.h"
#include "tests/metrics/reference_files.h"

namespace tsdfpp {
namespace {

const char* const kTruthFile = "freiburg1_xyz-groundtruth.txt";

constexpr double kEvoDigits = 1e-8;
constexpr double kEvoDegrees = 1e-6;

void ExpectSummary(const MeasuredSummary& summary, const nlohmann::json& expected,
                   double tolerance) {
  ASSERT_TRUE(summary.value) << summary.why_not;
  EXPECT_NEAR(summary.value->rmse, expected["rmse"], tolerance);
  EXPECT_NEAR(summary.value->mean, expected["mean"], tolerance);
  EXPECT_NEAR(summary.value->median, expected["median"], tolerance);
  EXPECT_NEAR(summary.value->standard_deviation, expected["std"], tolerance);
  EXPECT_NEAR(summary.value->smallest, expected["min"], tolerance);
  EXPECT_NEAR(summary.value->largest, expected["max"], tolerance);
  const double sse = expected["sse"];
  EXPECT_NEAR(summary.value->squares_sum, sse, tolerance * std::max(1.0, 100 * sse));
}

TEST(RelativeErrors, EqualEvo) {
  const auto expected = testing::ReadJson(testing::EvoFile("expected_evo.json"));
  const StampedTrajectory truth = testing::ReadTum(testing::EvoFile(kTruthFile));
  using Unit = RelativeDelta::Unit;
  const std::array<std::pair<RelativeDelta, std::string>, 4> deltas = {
      {{{1, Unit::kFrames, false}, "delta1frames"},
       {{10, Unit::kFrames, false}, "delta10frames"},
       {{10, Unit::kFrames, true}, "delta10frames_allpairs"},
       {{0.1, Unit::kMetres, false}, "delta0.1m"}}};
  for (const auto& [name, numbers] : expected.items()) {
    TrajectoryOptions options;
    options.deltas.clear();
    for (const auto& [delta, key] : deltas) options.deltas.push_back(delta);
    if (!std::filesystem::exists(testing::EvoFile(name))) continue;
    const TrajectoryReport report =
        ReportTrajectory(truth, testing::ReadTum(testing::EvoFile(name)), options);
    for (std::size_t k = 0; k < deltas.size(); ++k) {
      const std::string& key = deltas[k].second;
      SCOPED_TRACE(name + " " + key);
      ASSERT_EQ(report.relative[k].stretches, numbers["rpe_trans_" + key]["n"].get<std::size_t>());
      ExpectSummary(report.relative[k].translation_m, numbers["rpe_trans_" + key], kEvoDigits);
      ExpectSummary(report.relative[k].rotation_deg, numbers["rpe_rot_deg_" + key], kEvoDegrees);
    }
  }
  TSDFPP_NEEDS_SHARED("metric_refs/evo_tum");
}

TEST(RelativeErrors, EqualTumTools) {
  const StampedTrajectory truth = testing::ReadTum(testing::EvoFile(kTruthFile));
  // rmse mean median std min max of the translation, then of the rotation in degrees, as
  // evaluate_rpe.py --fixed_delta --max_pairs 0 prints them.
  struct Case {
    const char* name;
    DeltaUnit unit;
    std::size_t stretches;
    std::array<double, 12> printed;
  };
  const std::array<Case, 3> cases = {
      Case{"freiburg1_xyz-rgbdslam.txt",
           DeltaUnit::kSeconds,
           753,
           {0.021217, 0.019524, 0.019309, 0.008307, 0.000125, 0.048152, 0.934480, 0.841472,
            0.801085, 0.406421, 0.051003, 2.295985}},
      Case{"freiburg1_xyz-rgbdslam_drift.txt",
           DeltaUnit::kSeconds,
           753,
           {0.021217, 0.019524, 0.019308, 0.008307, 0.000125, 0.048151, 0.934484, 0.841476,
            0.801079, 0.406422, 0.051031, 2.296030}},
      Case{"freiburg1_xyz-rgbdslam.txt",
           DeltaUnit::kFrames,
           783,
           {0.005763, 0.004816, 0.004123, 0.003165, 0.000171, 0.021212, 0.352969, 0.300080,
            0.262955, 0.185846, 0.016937, 1.633296}}};
  constexpr double kPrinted = 5.01e-7;
  for (const Case& expected : cases) {
    SCOPED_TRACE(expected.name);
    if (!std::filesystem::exists(testing::EvoFile(expected.name))) continue;
    RelativeErrors errors = TumRelativePoseErrors(
        truth, testing::ReadTum(testing::EvoFile(expected.name)), 1, expected.unit);
    ASSERT_EQ(errors.translation_m.size(), expected.stretches);
    for (double& angle : errors.rotation_rad) angle *= kDegPerRad;
    const std::array summaries = {SummariseErrors(errors.translation_m),
                                  SummariseErrors(errors.rotation_rad)};
    for (std::size_t k = 0; k < 2; ++k) {
      const double* printed = expected.printed.data() + 6 * k;
      EXPECT_NEAR(summaries[k]->rmse, printed[0], kPrinted);
      EXPECT_NEAR(summaries[k]->mean, printed[1], kPrinted);
      EXPECT_NEAR(summaries[k]->median, printed[2], kPrinted);
      EXPECT_NEAR(summaries[k]->standard_deviation, printed[3], kPrinted);
      EXPECT_NEAR(summaries[k]->smallest, printed[4], kPrinted);
      EXPECT_NEAR(summaries[k]->largest, printed[5], kPrinted);
    }
  }
  TSDFPP_NEEDS_SHARED("metric_refs/evo_tum");
}

TEST(Stretches, ByFrames) {
  const auto ends = [](const std::vector<Stretch>& stretches) {
    std::vector<std::pair<std::size_t, std::size_t>> out;
    for (const Stretch& s : stretches) out.emplace_back(s.from, s.to);
    return out;
  };
  using Ends = std::vector<std::pair<std::size_t, std::size_t>>;
  EXPECT_EQ(ends(StretchesByFrames(6, 2)), (Ends{{0, 2}, {2, 4}}));
  EXPECT_EQ(ends(StretchesByFrames(7, 2)), (Ends{{0, 2}, {2, 4}, {4, 6}}));
  EXPECT_EQ(ends(StretchesByFrames(5, 2, true)), (Ends{{0, 2}, {1, 3}, {2, 4}}));
  EXPECT_TRUE(StretchesByFrames(2, 2).empty());
  EXPECT_TRUE(StretchesByFrames(9, 0).empty());
}

// Steps of 3 cm: 10 cm are reached after four, and the first cut starts the first stretch.
TEST(Stretches, ByPath) {
  PosePairs pairs;
  for (int i = 0; i < 14; ++i) {
    pairs.frames.push_back(i);
    pairs.estimate.emplace_back(Pose(Eigen::Translation3d(0.03 * i, 0, 0)));
    // The truth stands still: the way is the estimate's.
    pairs.truth.push_back(Pose::Identity());
  }
  const auto stretches = StretchesByPath(pairs, 0.1);
  ASSERT_EQ(stretches.size(), 2U);
  EXPECT_EQ(stretches[0].from, 4U);
  EXPECT_EQ(stretches[0].to, 8U);
  EXPECT_EQ(stretches[1].to, 12U);
  EXPECT_NEAR(RelativePoseErrors(pairs, stretches).translation_m[0], 0.12, 1e-12);
  EXPECT_TRUE(StretchesByPath(pairs, 1).empty());
}

// An estimate that drifts by 1 mm and 0.01 rad a frame, in its own frame.
TEST(RelativeErrors, OfAKnownDrift) {
  PosePairs pairs;
  const Pose step(Eigen::Translation3d(0.02, 0, 0) *
                  Eigen::AngleAxisd(0.05, Eigen::Vector3d::UnitZ()));
  const Pose drift(Eigen::Translation3d(0, 0, 0.001) *
                   Eigen::AngleAxisd(0.01, Eigen::Vector3d::UnitX()));
  Pose truth = Pose::Identity();
  Pose estimate(Eigen::Translation3d(5, 5, 5));
  for (int i = 0; i < 10; ++i) {
    pairs.frames.push_back(i);
    pairs.truth.push_back(truth);
    pairs.estimate.push_back(estimate);
    truth = truth * step;
    estimate = estimate * step * drift;
  }
  const RelativeErrors errors = RelativePoseErrors(pairs, 1);
  ASSERT_EQ(errors.translation_m.size(), 9U);
  for (std::size_t i = 0; i < 9; ++i) {
    EXPECT_NEAR(errors.translation_m[i], 0.001, 1e-12);
    EXPECT_NEAR(errors.rotation_rad[i], 0.01, 1e-9);
  }
}

// TUM measures backwards: of a pure turn, the truth's way is turned with it.
TEST(RelativeErrors, TumMeasuresBackwards) {
  StampedTrajectory truth;
  StampedTrajectory estimate;
  for (int i = 0; i < 5; ++i) {
    truth.emplace(i, Pose(Eigen::Translation3d(0.1 * i, 0, 0)));
    estimate.emplace(i, Pose(Eigen::Translation3d(0.1 * i, 0, 0) *
                             Eigen::AngleAxisd(0.2 * i, Eigen::Vector3d::UnitZ())));
  }
  const RelativeErrors errors = TumRelativePoseErrors(truth, estimate, 1, DeltaUnit::kFrames);
  // Four stretches, the last pose's left out. P = (turned by 0.2 i back, 0.1 m), Q = 0.1 m along x.
  ASSERT_EQ(errors.translation_m.size(), 3U);
  for (std::size_t i = 0; i < 3; ++i) {
    const double turn = 0.2 * static_cast<double>(i);
    // |t_P - R_P t_Q| = 0.1 |e^(-i turn) - e^(i 0.2)|.
    EXPECT_NEAR(errors.translation_m[i], 0.2 * std::sin((turn + 0.2) / 2), 1e-12);
    EXPECT_NEAR(errors.rotation_rad[i], 0.2, 1e-9);
  }
  // The truth is too far in time: more than twice its interval of 1 s.
  StampedTrajectory late;
  for (const auto& [stamp_s, pose] : estimate) late.emplace(stamp_s + 4.5, pose);
  EXPECT_EQ(TumRelativePoseErrors(truth, late, 1, DeltaUnit::kFrames).translation_m.size(), 1U);
  EXPECT_TRUE(TumRelativePoseErrors({}, late, 1, DeltaUnit::kFrames).translation_m.empty());
}

StampedTrajectory Arc(int poses, double scale) {
  StampedTrajectory trajectory;
  for (int i = 0; i < poses; ++i) {
    const double a = 0.3 * i;
    trajectory.emplace(0.1 * i, Pose(Eigen::Translation3d(scale * std::cos(a), scale * std::sin(a),
                                                          scale * 0.1 * i) *
                                     Eigen::AngleAxisd(a, Eigen::Vector3d::UnitZ())));
  }
  return trajectory;
}

TEST(TrajectoryReport, ScaleIsAlignedOnlyBySim3) {
  TrajectoryOptions options;
  options.deltas = {{1, RelativeDelta::Unit::kFrames, false},
                    {0.2, RelativeDelta::Unit::kSeconds, false}};
  options.align = AlignmentKind::kSim3;
  const TrajectoryReport sim3 = ReportTrajectory(Arc(20, 1), Arc(20, 0.5), options);
  EXPECT_NEAR(sim3.alignment->scale, 2, 1e-12);
  EXPECT_NEAR(sim3.translation_m.value->rmse, 0, 1e-12);
  EXPECT_NEAR(sim3.relative[0].translation_m.value->rmse, 0, 1e-12);
  EXPECT_NEAR(sim3.relative[1].translation_m.value->rmse, 0, 1e-12);
  EXPECT_NEAR(sim3.truth_length_m, 2 * sim3.estimate_length_m, 1e-12);
  options.align = AlignmentKind::kSe3;
  const TrajectoryReport se3 = ReportTrajectory(Arc(20, 1), Arc(20, 0.5), options);
  EXPECT_GT(se3.translation_m.value->rmse, 0.3);
  const double step_m = std::hypot(2 * std::sin(0.15), 0.1);
  EXPECT_NEAR(se3.relative[0].translation_m.value->mean, 0.5 * step_m, 1e-12);
  EXPECT_FALSE(ReportTrajectory(Arc(20, 1), Arc(20, 0.5), {}).alignment);
}

TEST(TrajectoryReport, SaysWhyAValueIsUndefined) {
  TrajectoryOptions options;
  options.align = AlignmentKind::kSe3;
  options.deltas = {{5, RelativeDelta::Unit::kFrames, false}};
  // Two pairs.
  TrajectoryReport report = ReportTrajectory(Arc(20, 1), Arc(2, 1), options);
  EXPECT_EQ(report.pairs, 2U);
  EXPECT_FALSE(report.translation_m.value);
  EXPECT_EQ(report.translation_m.why_not, "an alignment needs 3 pairs of poses, found 2");
  EXPECT_EQ(report.relative[0].translation_m.why_not, "no stretch of 5 frames in 2 pairs of poses");
  // None.
  StampedTrajectory late;
  for (const auto& [stamp_s, pose] : Arc(5, 1)) late.emplace(stamp_s + 100, pose);
  report = ReportTrajectory(Arc(20, 1), late, options);
  EXPECT_EQ(report.pairs, 0U);
  EXPECT_EQ(report.translation_m.why_not, "no pose of the estimate is within 0.01 s of a true one");
  EXPECT_EQ(report.full.why_not, report.translation_m.why_not);
  // A line: translations have an alignment, rotations not.
  StampedTrajectory line;
  for (int i = 0; i < 9; ++i) line.emplace(0.1 * i, Pose(Eigen::Translation3d(0.1 * i, 0, 0)));
  report = ReportTrajectory(line, line, options);
  EXPECT_NEAR(report.translation_m.value->largest, 0, 1e-12);
  EXPECT_FALSE(report.rotation_deg.value);
  EXPECT_NE(report.rotation_deg.why_not.find("line"), std::string::npos);
  // Not aligned, one pair is enough.
  report = ReportTrajectory(Arc(20, 1), Arc(1, 1), {});
  EXPECT_EQ(report.translation_m.value->rmse, 0);
  EXPECT_FALSE(report.relative[0].translation_m.value);
}

}  // namespace
}  // namespace tsdfpp
