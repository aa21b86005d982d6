// Drift and jitter of the camera pose against the closed forms of a random walk.
#include "sim/sensor/pose_noise.h"

#include <gtest/gtest.h>

#include <numbers>

#include "core/units.h"
#include "tests/sim/sensor_images.h"

namespace tsdfpp {
namespace {

constexpr double kRoundOff = 1e-12;

Pose SomePose() {
  Pose pose = Pose::Identity();
  pose.linear() = (Eigen::AngleAxisd(0.7, Eigen::Vector3d::UnitX()) *
                   Eigen::AngleAxisd(-1.9, Eigen::Vector3d::UnitZ()))
                      .toRotationMatrix();
  pose.translation() = Eigen::Vector3d(0.4, -3, 1.2);
  return pose;
}

TEST(PoseNoise, ExactIsTheSamePose) {
  const Pose sensed = SenseCameraPose({}, 3, 40, 1, SomePose());
  EXPECT_EQ(sensed.matrix(), SomePose().matrix());
}

TEST(PoseNoise, TheFirstFrameHasNoDrift) {
  const CameraPoseConfig config{.drift_m = 0.1, .drift_deg = 5};
  for (const int first : {0, 1, 5}) {
    EXPECT_EQ(SenseCameraPose(config, 3, first, first, SomePose()).matrix(), SomePose().matrix());
    EXPECT_NE(SenseCameraPose(config, 3, first + 1, first, SomePose()).matrix(),
              SomePose().matrix());
  }
}

// Over many seeds: n frames after the first the variance of each axis is n steps' variance, and
// what two frames share is the variance of the earlier one.
TEST(PoseNoise, DriftIsARandomWalk) {
  const CameraPoseConfig config{.drift_m = 0.002, .drift_deg = 0.1};
  constexpr int kSeeds = 3000;
  for (const int frame : {2, 10, 101}) {
    Moments translation;
    Moments rotation;
    Moments shared;
    for (std::uint64_t seed = 0; seed < kSeeds; ++seed) {
      const PoseError error = PoseDrift(config, seed, frame, 1);
      const PoseError later = PoseDrift(config, seed, frame + 7, 1);
      for (int axis = 0; axis < 3; ++axis) {
        translation.Add(error.translation_W[axis]);
        rotation.Add(error.rotation_W[axis]);
        shared.Add(error.translation_W[axis] * later.translation_W[axis]);
      }
    }
    const double steps = frame - 1;
    ExpectNormal(translation, 0, 0.002 * std::sqrt(steps));
    ExpectNormal(rotation, 0, 0.1 * kDegree * std::sqrt(steps));
    const double variance = 0.002 * 0.002 * steps;
    // The product of two normal numbers spreads at most like their variances' product twice.
    const double spread = std::sqrt(variance * 0.002 * 0.002 * (2 * steps + 7));
    EXPECT_NEAR(shared.Mean(), variance, kSigmas * spread / std::sqrt(shared.count));
  }
}

// The steps of one long walk are normal and independent of each other.
TEST(PoseNoise, StepsAreIndependent) {
  const CameraPoseConfig config{.drift_m = 1};
  Moments steps;
  Moments products;
  double last = 0;
  PoseError before = PoseDrift(config, 8, 1, 1);
  for (int frame = 2; frame < 1500; ++frame) {
    const PoseError error = PoseDrift(config, 8, frame, 1);
    const double step = error.translation_W.x() - before.translation_W.x();
    steps.Add(step);
    products.Add(step * last);
    last = step;
    before = error;
  }
  ExpectNormal(steps, 0, 1);
  EXPECT_NEAR(products.Mean(), 0, kSigmas / std::sqrt(products.count));
}

TEST(PoseNoise, JitterIsIndependentFromFrameToFrame) {
  const CameraPoseConfig config{.jitter_m = 0.003, .jitter_deg = 0.2};
  Moments translation;
  Moments rotation;
  Moments products;
  for (int frame = 1; frame <= 5000; ++frame) {
    const PoseError error = PoseJitter(config, 4, frame);
    const PoseError next = PoseJitter(config, 4, frame + 1);
    for (int axis = 0; axis < 3; ++axis) {
      translation.Add(error.translation_W[axis]);
      rotation.Add(error.rotation_W[axis]);
      products.Add(error.translation_W[axis] * next.translation_W[axis]);
    }
  }
  ExpectNormal(translation, 0, 0.003);
  ExpectNormal(rotation, 0, 0.2 * kDegree);
  EXPECT_NEAR(products.Mean(), 0, kSigmas * 0.003 * 0.003 / std::sqrt(products.count));
}

TEST(PoseNoise, ErrorsTurnAboutTheCameraAndMoveInTheWorld) {
  const PoseError error{{0.1, 0.2, -0.3}, {0, 0, std::numbers::pi / 2}};
  const Pose given = WithPoseError(SomePose(), error);
  EXPECT_NEAR((given.translation() - SomePose().translation() - error.translation_W).norm(), 0,
              kRoundOff);
  // A quarter turn about the world's z axis takes x to y.
  const Eigen::Vector3d axis = SomePose().linear().col(2);
  const Eigen::Vector3d turned = given.linear().col(2);
  EXPECT_NEAR((turned - Eigen::Vector3d(-axis.y(), axis.x(), axis.z())).norm(), 0, kRoundOff);
  const CameraPoseConfig config{0.01, 1, 0.01, 1};
  const Pose sensed = SenseCameraPose(config, 5, 300, 1, SomePose());
  EXPECT_NEAR((sensed.linear() * sensed.linear().transpose() - Eigen::Matrix3d::Identity()).norm(),
              0, kRoundOff);
  EXPECT_NEAR(sensed.linear().determinant(), 1, kRoundOff);
}

TEST(PoseNoise, GrowsInProportionToItsSize) {
  const PoseError one = PoseDrift({.drift_m = 0.001, .drift_deg = 0.1}, 6, 50, 1);
  const PoseError two = PoseDrift({.drift_m = 0.002, .drift_deg = 0.2}, 6, 50, 1);
  EXPECT_NEAR((two.translation_W - 2 * one.translation_W).norm(), 0, kRoundOff);
  EXPECT_NEAR((two.rotation_W - 2 * one.rotation_W).norm(), 0, kRoundOff);
}

}  // namespace
}  // namespace tsdfpp
