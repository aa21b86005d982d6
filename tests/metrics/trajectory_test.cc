#include "metrics/trajectory.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <numbers>
#include <sstream>

#include "tests/metrics/test_scenes.h"

namespace tsdfpp {
namespace {

constexpr double kDegPerRad = 180 / std::numbers::pi;
const std::filesystem::path kEvo =
    std::filesystem::path(TSDFPP_SHARED_DIR) / "data/metric_refs/evo_tum";

struct Stamped {
  std::vector<double> stamps;
  std::vector<Pose> poses;
};

Stamped ReadTum(const std::string& name) {
  Stamped out;
  std::ifstream file(kEvo / name);
  for (std::string line; std::getline(file, line);) {
    if (line.empty() || line[0] == '#') continue;
    std::istringstream fields(line);
    double stamp = 0;
    Eigen::Vector3d t;
    Eigen::Quaterniond q;
    fields >> stamp >> t.x() >> t.y() >> t.z() >> q.x() >> q.y() >> q.z() >> q.w();
    out.stamps.push_back(stamp);
    out.poses.emplace_back(Eigen::Translation3d(t) * q.normalized());
  }
  return out;
}

// As evo associates: for each pose of the shorter trajectory the nearest of the longer.
PosePairs Associate(const Stamped& truth, const Stamped& estimate, double max_difference_s) {
  const bool truth_is_shorter = truth.stamps.size() < estimate.stamps.size();
  const Stamped& shorter = truth_is_shorter ? truth : estimate;
  const Stamped& longer = truth_is_shorter ? estimate : truth;
  PosePairs pairs;
  for (std::size_t i = 0; i < shorter.stamps.size(); ++i) {
    std::size_t best = 0;
    for (std::size_t j = 0; j < longer.stamps.size(); ++j) {
      if (std::abs(longer.stamps[j] - shorter.stamps[i]) <
          std::abs(longer.stamps[best] - shorter.stamps[i])) {
        best = j;
      }
    }
    if (std::abs(longer.stamps[best] - shorter.stamps[i]) > max_difference_s) continue;
    pairs.frames.push_back(static_cast<int>(i));
    pairs.truth.push_back(truth_is_shorter ? shorter.poses[i] : longer.poses[best]);
    pairs.estimate.push_back(truth_is_shorter ? longer.poses[best] : shorter.poses[i]);
  }
  return pairs;
}

// evo keeps 17 digits; its quaternion arithmetic and ours differ in the last few.
constexpr double kEvoDigits = 1e-8;
constexpr double kEvoDegrees = 1e-6;

void ExpectSummary(const std::vector<double>& errors, double unit, const nlohmann::json& expected,
                   double tolerance, const std::string& what) {
  const auto summary = SummariseErrors(errors);
  ASSERT_TRUE(summary) << what;
  EXPECT_NEAR(summary->rmse * unit, expected["rmse"], tolerance) << what;
  EXPECT_NEAR(summary->mean * unit, expected["mean"], tolerance) << what;
  EXPECT_NEAR(summary->median * unit, expected["median"], tolerance) << what;
  EXPECT_NEAR(summary->standard_deviation * unit, expected["std"], tolerance) << what;
  EXPECT_NEAR(summary->smallest * unit, expected["min"], tolerance) << what;
  EXPECT_NEAR(summary->largest * unit, expected["max"], tolerance) << what;
}

TEST(Trajectory, EqualsEvo) {
  std::ifstream file(kEvo / "expected_evo.json");
  if (!file) GTEST_SKIP() << "no " << kEvo;
  const auto expected = nlohmann::json::parse(file);
  const Stamped truth = ReadTum("freiburg1_xyz-groundtruth.txt");
  for (const auto& [name, numbers] : expected.items()) {
    const PosePairs pairs = Associate(truth, ReadTum(name), numbers["t_max_diff"]);
    ASSERT_EQ(pairs.size(), numbers["matched_pairs"].get<std::size_t>()) << name;
    ExpectSummary(TranslationErrors_m(pairs), 1, numbers["ape_trans_none"], kEvoDigits, name);
    ExpectSummary(RotationErrors_rad(pairs), kDegPerRad, numbers["ape_rot_deg_none"], kEvoDegrees,
                  name);
    for (const bool with_scale : {false, true}) {
      const std::string kind = with_scale ? "sim3" : "se3";
      const auto alignment = AlignHorn(pairs, with_scale);
      ASSERT_TRUE(alignment);
      EXPECT_NEAR(alignment->scale, numbers["align_" + kind]["s"], kEvoDigits) << name;
      const PosePairs aligned = Aligned(pairs, *alignment);
      ExpectSummary(TranslationErrors_m(aligned), 1, numbers["ape_trans_" + kind], kEvoDigits,
                    name + kind);
      ExpectSummary(RotationErrors_rad(aligned), kDegPerRad, numbers["ape_rot_deg_" + kind],
                    kEvoDegrees, name + kind);
    }
    for (const auto& [delta, overlapping, suffix] : {std::tuple{1, false, "delta1frames"},
                                                     {10, false, "delta10frames"},
                                                     {10, true, "delta10frames_allpairs"}}) {
      const RelativeErrors relative =
          RelativePoseErrors(pairs, static_cast<std::size_t>(delta), overlapping);
      const std::string key = suffix;
      ASSERT_EQ(relative.translation_m.size(), numbers["rpe_trans_" + key]["n"].get<std::size_t>());
      ExpectSummary(relative.translation_m, 1, numbers["rpe_trans_" + key], kEvoDigits, name + key);
      ExpectSummary(relative.rotation_rad, kDegPerRad, numbers["rpe_rot_deg_" + key], kEvoDegrees,
                    name + key);
    }
  }
}

TEST(Trajectory, EqualsTumTools) {
  if (!std::filesystem::exists(kEvo)) GTEST_SKIP() << "no " << kEvo;
  // evaluate_ate.py associates within 0.02 s and prints six digits.
  const PosePairs pairs = Associate(ReadTum("freiburg1_xyz-groundtruth.txt"),
                                    ReadTum("freiburg1_xyz-rgbdslam.txt"), 0.02);
  ASSERT_EQ(pairs.size(), 786U);
  const auto alignment = AlignHorn(pairs);
  ASSERT_TRUE(alignment);
  EXPECT_NEAR(SummariseErrors(TranslationErrors_m(Aligned(pairs, *alignment)))->rmse, 0.013473,
              5e-7);
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
  EXPECT_FALSE(AddError_m({}, Pose::Identity(), Pose::Identity()).value);
  EXPECT_FALSE(AddSymmetricError_m({}, Pose::Identity(), Pose::Identity()).value);
}

}  // namespace
}  // namespace tsdfpp
