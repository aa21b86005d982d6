#include "core/pose_text.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "core/random.h"

namespace tsdfpp {
namespace {

// Half a step of nine decimals, in each of a few numbers, and as much again from normalising.
constexpr double kTextTolerance = 3e-9;  // metres; and of matrix entries
constexpr int kPoses = 20000;

Pose RandomPose(std::uint64_t i) {
  const auto u = UniformDraw(7, 0, i);
  const auto t = UniformDraw(7, 1, i);
  // Uniform rotation (Shoemake 1992).
  const double a = std::sqrt(1 - u[0]);
  const double b = std::sqrt(u[0]);
  constexpr double kTurn = 2 * std::numbers::pi;
  Pose pose = Pose::Identity();
  pose.linear() = Eigen::Quaterniond(b * std::cos(kTurn * u[2]), a * std::sin(kTurn * u[1]),
                                     a * std::cos(kTurn * u[1]), b * std::sin(kTurn * u[2]))
                      .toRotationMatrix();
  pose.translation() = 20 * (Eigen::Vector3d(t[0], t[1], t[2]).array() - 0.5).matrix();
  return pose;
}

bool SameBits(const Pose& a, const Pose& b) { return a.matrix() == b.matrix(); }

void ExpectFixedPoint(const Pose& pose) {
  const std::string text = PoseToText(pose);
  const auto read = PoseFromText(text);
  ASSERT_TRUE(read.has_value()) << read.error().message;
  EXPECT_EQ(PoseToText(*read), text);
  EXPECT_LT((read->matrix() - pose.matrix()).cwiseAbs().maxCoeff(), kTextTolerance) << text;
  EXPECT_TRUE(SameBits(PoseThroughText(*read), *read)) << text;
}

TEST(PoseText, TextIsAFixedPointForRandomPoses) {
  for (int i = 0; i < kPoses; ++i) ExpectFixedPoint(RandomPose(static_cast<std::uint64_t>(i)));
}

TEST(PoseText, TextIsAFixedPointForHalfTurnsAndTies) {
  for (const double x : {-1.0, 0.0, 1.0}) {
    for (const double y : {-1.0, 0.0, 1.0}) {
      for (const double z : {-1.0, 0.0, 1.0}) {
        if (x == 0 && y == 0 && z == 0) continue;
        for (const double angle : {std::numbers::pi, std::numbers::pi - 1e-10,
                                   std::numbers::pi + 1e-10, std::numbers::pi / 2, 1e-10, 1e-9}) {
          Pose pose = Pose::Identity();
          pose.linear() = Eigen::AngleAxisd(angle, Eigen::Vector3d(x, y, z).normalized()).matrix();
          pose.translation() = Eigen::Vector3d(-1e-12, 1e-12, -0.0);
          ExpectFixedPoint(pose);
        }
      }
    }
  }
}

TEST(PoseText, IdentityIsExact) {
  EXPECT_EQ(PoseToText(Pose::Identity()),
            "0.000000000 0.000000000 0.000000000 0.000000000 0.000000000 0.000000000 1.000000000");
  EXPECT_TRUE(SameBits(PoseThroughText(Pose::Identity()), Pose::Identity()));
}

TEST(PoseText, NothingIsBeyondAllDistance) {
  EXPECT_TRUE(PoseFromText("-1e7 0 1e7 0 0 0 1").has_value());
  for (const char* text : {"1.1e7 0 0 0 0 0 1", "0 -1e20 0 0 0 0 1", "0 0 1e307 0 0 0 1"}) {
    const auto pose = PoseFromText(text);
    ASSERT_FALSE(pose.has_value()) << text;
    EXPECT_NE(pose.error().message.find("m from the origin, expected at most 1e+07"),
              std::string::npos)
        << pose.error().message;
  }
}

TEST(PoseText, NoMinusZero) {
  Pose pose = Pose::Identity();
  pose.translation() = Eigen::Vector3d(-1e-12, -0.0, -10);
  EXPECT_TRUE(PoseToText(pose).starts_with("0.000000000 0.000000000 -10.000000000 "));
}

TEST(PoseText, OrderIsTranslationThenXyzw) {
  // A quarter turn about z takes x to y.
  const Pose pose = PoseFromText("1 2 3\t0 0 0.70710678 0.70710678\r").value();
  EXPECT_LT((pose * Eigen::Vector3d(1, 0, 0) - Eigen::Vector3d(1, 3, 3)).norm(), kTextTolerance);
}

TEST(PoseText, BadTextIsNamed) {
  const struct {
    const char* text;
    const char* sentence;
  } cases[] = {
      {"", "'' is not a pose: expected seven numbers tx ty tz qx qy qz qw"},
      {"1 2 3 0 0 0", "'1 2 3 0 0 0' is not a pose: expected seven numbers tx ty tz qx qy qz qw"},
      {"1 2 x 0 0 0 1",
       "'1 2 x 0 0 0 1' is not a pose: expected seven numbers tx ty tz qx qy qz qw"},
      {"1 2 nan 0 0 0 1",
       "'1 2 nan 0 0 0 1' is not a pose: expected seven numbers tx ty tz qx qy qz qw"},
      {"1 2 3 0 0 0 inf",
       "'1 2 3 0 0 0 inf' is not a pose: expected seven numbers tx ty tz qx qy qz qw"},
      {"1 2 3 0 0 0 1 4",
       "'1 2 3 0 0 0 1 4' is not a pose: more than the seven numbers tx ty tz qx qy qz qw"},
      {"1 2 3 0 0 0 1.002",
       "'1 2 3 0 0 0 1.002' is not a pose: the quaternion's length is 1.002000, not 1"},
      {"1 2 3 0 0 0 0",
       "'1 2 3 0 0 0 0' is not a pose: the quaternion's length is 0.000000, not 1"},
  };
  for (const auto& [text, sentence] : cases) {
    const auto pose = PoseFromText(text);
    ASSERT_FALSE(pose.has_value()) << text;
    EXPECT_EQ(pose.error().kind, ErrorKind::kData);
    EXPECT_EQ(pose.error().message, sentence);
  }
}

}  // namespace
}  // namespace tsdfpp
