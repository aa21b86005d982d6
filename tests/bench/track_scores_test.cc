// Scores of an object whose estimate is off by known shifts and turns.
#include "bench/track_scores.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace tsdfpp {
namespace {

constexpr double kRounding = 1e-6;      // metres: points are in single precision
constexpr double kRounding_deg = 1e-4;  // of angles from matrices
constexpr double kDegrees = std::numbers::pi / 180;

Pose At(double x, double turn_rad = 0) {
  return Eigen::Translation3d(x, 0.2, 0.1) * Eigen::AngleAxisd(turn_rad, Eigen::Vector3d::UnitZ()) *
         Pose::Identity();
}

// Four frames in which the object drives 1 cm each.
TrackedObject Driving() {
  TrackedObject object;
  for (int i = 1; i <= 4; ++i) object.T_WO_truth[i] = At(0.01 * i);
  object.shown = {1, 2, 3, 4};
  object.points_O = {{0.1F, 0, 0}, {-0.1F, 0, 0}, {0, 0.1F, 0}, {0, -0.1F, 0}};
  return object;
}

TEST(TrackScores, AnotherFrameOfTheObjectIsNoError) {
  TrackedObject object = Driving();
  const Pose C = At(0.4, 1.2);
  for (const auto& [i, T_WO] : object.T_WO_truth) object.T_WO_estimate[i] = T_WO * C;
  const TrackScores scores = ScoreTracked(object);
  EXPECT_EQ(scores.frames, 4U);
  EXPECT_NEAR(scores.moved_m, 0.03, kRounding);
  EXPECT_NEAR(*scores.trajectory.ate_rmse_m.value, 0, kRounding);
  EXPECT_NEAR(*scores.add_m.value, 0, kRounding);
  EXPECT_EQ(*scores.within_5mm.value, 1);
}

TEST(TrackScores, ShiftsCountWhereTheObjectIsShown) {
  TrackedObject object = Driving();
  object.T_WO_estimate = {{1, At(0.01)}, {2, At(0.024)}, {3, At(0.8)}, {4, At(0.07)}};
  object.shown = {1, 2, 4};
  const TrackScores scores = ScoreTracked(object);
  EXPECT_EQ(scores.frames, 3U);
  EXPECT_NEAR(scores.farthest_m, 0.03, kRounding);
  EXPECT_NEAR(scores.end_m, 0.03, kRounding);
  EXPECT_NEAR(*scores.trajectory.ate_rmse_m.value, std::sqrt((0.004 * 0.004 + 0.03 * 0.03) / 3),
              kRounding);
  EXPECT_NEAR(*scores.add_m.value, 0.034 / 3, kRounding);
  EXPECT_NEAR(*scores.within_5mm.value, 2.0 / 3, kRounding);
  EXPECT_NEAR(*scores.within_2cm.value, 2.0 / 3, kRounding);
}

MotionUncertainty Known(int since, const Eigen::Vector3d& centre_W, double deviation_m) {
  MotionUncertainty motion{since, {centre_W, 0.1}, {}, 0};
  motion.covariance_m2 = deviation_m * deviation_m * Matrix6::Identity();
  return motion;
}

// Off by 2 mm where 1 mm is expected, in one of six lengths; and by nothing afterwards.
TEST(TrackScores, MotionsAreOffByWhatIsKnownOfThem) {
  TrackedObject object = Driving();
  object.T_WO_estimate = {{1, At(0.01)}, {2, At(0.022)}, {3, At(0.032)}};
  object.motions = {{2, Known(1, {0.02, 0.2, 0.1}, 0.001)}, {3, Known(2, {0.03, 0.2, 0.1}, 0.001)}};
  EXPECT_NEAR(*ScoreTracked(object).nees.value, 4.0 / 6 / 2, kRounding);
  // A turn that is free is not counted.
  object.motions[2].free_directions = 2;
  const TrackScores scores = ScoreTracked(object);
  EXPECT_NEAR(*scores.nees.value, 4.0 / 4 / 2, kRounding);
  EXPECT_EQ(scores.free_directions, 1);
}

TEST(TrackScores, MotionsAreLeftOutWhereNothingMovesOrIsSeen) {
  TrackedObject object = Driving();
  object.T_WO_truth[3] = object.T_WO_truth[2];
  object.T_WO_estimate = {{1, At(0.01)}, {2, At(0.022)}, {3, At(0.032)}, {4, At(0.04)}};
  object.shown = {1, 2, 3};
  object.motions = {{2, Known(0, {0.02, 0.2, 0.1}, 0.001)},   // nothing is known of frame 0
                    {3, Known(2, {0.02, 0.2, 0.1}, 0.001)},   // at rest
                    {4, Known(3, {0.03, 0.2, 0.1}, 0.001)}};  // not shown
  EXPECT_FALSE(ScoreTracked(object).nees.value);
}

// What only turns has moved, too.
TEST(TrackScores, TurningIsMoving) {
  TrackedObject object = Driving();
  object.T_WO_truth = {{1, At(0)}, {2, At(0, 180 * kDegrees)}};
  object.T_WO_estimate = object.T_WO_truth;
  EXPECT_NEAR(ScoreTracked(object).moved_m, 0.2, kRounding);
}

// A quarter turn brings the four points onto each other: ADD-S sees nothing, ADD the way of each.
TEST(TrackScores, TurnsThatTheShapeHidesAreSeenByAddAlone) {
  TrackedObject object = Driving();
  object.T_WO_estimate = {{1, At(0.01)}, {2, At(0.02, 90 * kDegrees)}};
  const TrackScores scores = ScoreTracked(object);
  EXPECT_EQ(scores.frames, 2U);
  EXPECT_NEAR(*scores.trajectory.rotation_rmse_deg.value, 90 / std::numbers::sqrt2, kRounding_deg);
  EXPECT_NEAR(scores.farthest_m, 0, kRounding);
  // A point a tenth of a metre from the middle goes 1 cm on, as the middle does.
  EXPECT_NEAR(scores.moved_m, 0.01, kRounding);
  EXPECT_NEAR(*scores.add_m.value, 0.1 * std::numbers::sqrt2 / 2, kRounding);
  EXPECT_NEAR(*scores.add_s_m.value, 0, kRounding);
}

}  // namespace
}  // namespace tsdfpp
