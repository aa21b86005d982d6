// Covariances of motions: against samples of small motions that are carried over one by one.
#include "mapper/track/motion_uncertainty.h"

#include <gtest/gtest.h>

#include <cstdint>

#include "core/random.h"
#include "tests/reference/analytic_scene.h"

namespace tsdfpp {
namespace {

using reference::MakePose;

// Of a covariance from so many samples, relative to its largest entry.
constexpr int kSamples = 20000;
constexpr double kOfSamples = 0.05;
constexpr double kDeviation_m = 1e-4;  // small enough for turns to add up

Vector6 Draw(std::uint32_t stream, std::uint32_t i) {
  const auto first = GaussianDraw(3, stream, 2 * i);
  const auto second = GaussianDraw(3, stream, 2 * i + 1);
  Vector6 x;
  x << first[0], first[1], first[2], first[3], second[0], second[1];
  return kDeviation_m * x;
}

// A covariance that is not the identity's multiple, as x -> L x makes it.
Matrix6 Mixing() {
  Matrix6 L = Matrix6::Identity();
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < i; ++j) L(i, j) = 0.1 * (i - 2 * j);
  }
  return L;
}

void ExpectAlike(const Matrix6& covariance, const Matrix6& of_samples) {
  EXPECT_LT((covariance - of_samples).cwiseAbs().maxCoeff(),
            kOfSamples * of_samples.cwiseAbs().maxCoeff());
}

TEST(MotionUncertainty, IsThatOfTheSameMotionsInAnotherFrame) {
  const MotionFrame from{{0.1, -0.2, 0.3}, 0.05};
  const MotionFrame to{{0.14, -0.17, 0.26}, 0.08};
  const Matrix6 L = Mixing();
  Matrix6 samples = Matrix6::Zero();
  for (std::uint32_t i = 0; i < kSamples; ++i) {
    const Vector6 x = to.LengthsOf(from.MotionOf(L * Draw(0, i)));
    samples += x * x.transpose() / kSamples;
  }
  const Matrix6 covariance = kDeviation_m * kDeviation_m * L * L.transpose();
  ExpectAlike(CovarianceIn(to, from, covariance), samples);
}

// Two places that are off, each by its own draw: what the motion between them is off by in the
// world.
TEST(MotionUncertainty, IsThatOfBothPlacesInTheWorld) {
  const Pose T_WL_before = MakePose(0.7, {0.3, -1, 0.5}, {0.5, 0.2, -0.1});
  const Pose T_WL_after = MakePose(0.9, {0.2, -1, 0.6}, {0.55, 0.18, -0.1});
  const MotionFrame before_L{{0.02, 0.01, -0.03}, 0.05};
  const MotionFrame after_L{{0.03, 0.00, -0.01}, 0.06};
  const Eigen::Vector3d centre_W = T_WL_after * after_L.centre;
  const MotionFrame frame_W{centre_W, after_L.radius_m};
  const Matrix6 L = Mixing();
  Matrix6 samples = Matrix6::Zero();
  for (std::uint32_t i = 0; i < kSamples; ++i) {
    const Pose off_before = T_WL_before * before_L.MotionOf(L * Draw(1, i));
    const Pose off_after = T_WL_after * after_L.MotionOf(2 * Draw(2, i));
    const Pose motion = off_after * off_before.inverse();
    const Pose truth = T_WL_after * T_WL_before.inverse();
    const Vector6 x = frame_W.LengthsOf(motion * truth.inverse());
    samples += x * x.transpose() / kSamples;
  }
  const double square = kDeviation_m * kDeviation_m;
  const PlaceUncertainty before{before_L, square * L * L.transpose()};
  const PlaceUncertainty after{after_L, 4 * square * Matrix6::Identity()};
  const MotionUncertainty motion =
      UncertaintyOfMotion(before, after, T_WL_after.linear(), centre_W);
  EXPECT_EQ(motion.frame_W.centre, centre_W);
  EXPECT_EQ(motion.frame_W.radius_m, after_L.radius_m);
  ExpectAlike(motion.covariance_m2, samples);
}

}  // namespace
}  // namespace tsdfpp
