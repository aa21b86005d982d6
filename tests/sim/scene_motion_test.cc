// Scripted motion: splines, keyframes, and the poses that published results rest on.
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <string>

#include "core/pose_text.h"
#include "tests/sim/scene_files.h"

namespace tsdfpp {
namespace {

// FNV-1a of the text of all poses of a scene, frame by frame, the camera first.
std::uint64_t SumOfPoses(const SceneConfig& config) {
  std::uint64_t sum = 1469598103934665603U;
  const auto add = [&](const Pose& pose) {
    for (const char c : PoseToText(pose) + "\n") {
      sum = (sum ^ static_cast<unsigned char>(c)) * 1099511628211U;
    }
  };
  const SceneMotion motion = MotionOf(config);
  for (int frame = 1; frame <= config.frames; ++frame) {
    add(motion.T_WC(frame));
    for (const auto& [id, T_WO] : motion.T_WO(frame)) add(T_WO);
  }
  return sum;
}

// Results of these scenes are published: not a digit of a pose may change. The sums were taken
// before there was any other motion than drives and arcs.
TEST(SceneMotion, PublishedScenesKeepTheirPoses) {
  EXPECT_EQ(SumOfPoses(LoadScene("mini")), 0x31a7079412987c6cU);
  EXPECT_EQ(SumOfPoses(LoadScene("static")), 0x01f57387410f8e83U);
  EXPECT_EQ(SumOfPoses(LoadScene("toycar3")), 0xd4550ddae7e7c7d4U);
}

TEST(RestingSpline, NeverLeavesTheRangeOfItsNeighbours) {
  const std::vector<double> knots{0, 10, 14, 30, 31, 50};
  const std::vector<double> values{0.2, 0.9, 0.9, -0.4, 0.0, 0.1};
  const RestingSpline spline(knots, values);
  for (double t = -5; t <= 55; t += 0.05) {
    std::size_t i = 0;
    while (i + 2 < knots.size() && knots[i + 1] < t) ++i;
    const double value = spline.Value(t);
    EXPECT_GE(value, std::min(values[i], values[i + 1]) - 1e-12) << t;
    EXPECT_LE(value, std::max(values[i], values[i + 1]) + 1e-12) << t;
  }
  for (std::size_t i = 0; i < knots.size(); ++i) {
    EXPECT_NEAR(spline.Value(knots[i]), values[i], 1e-12);
  }
}

// Between two keys at rest the cubic is the smoothstep.
TEST(RestingSpline, TwoKeysGiveASmoothstep) {
  const RestingSpline spline({2, 6}, {1, 3});
  for (double u = 0; u <= 1; u += 0.01) {
    EXPECT_NEAR(spline.Value(2 + 4 * u), 1 + 2 * u * u * (3 - 2 * u), 1e-12);
  }
}

// The numbers of scipy.interpolate.pchip, whose inner slopes are the same: pchip([0,1,3,4,6],
// [0,1,2,5,6]) has the slopes 6/7 * ... at its inner knots; here from their definition by hand.
TEST(RestingSpline, InnerSlopesAreTheWeightedHarmonicMean) {
  const std::vector<double> slopes = RestingSlopes({0, 1, 3, 4, 6}, {0, 1, 2, 5, 6});
  ASSERT_EQ(slopes.size(), 5U);
  EXPECT_EQ(slopes.front(), 0);
  EXPECT_EQ(slopes.back(), 0);
  // h = 1, 2: w1 = 2 * 2 + 1 = 5, w2 = 2 + 2 * 1 = 4; chords 1 and 1/2: 9 / (5 / 1 + 4 / 0.5).
  EXPECT_NEAR(slopes[1], 9.0 / 13.0, 1e-12);
  // h = 2, 1: w1 = 4, w2 = 5; chords 1/2 and 3: 9 / (8 + 5 / 3).
  EXPECT_NEAR(slopes[2], 9.0 / (8.0 + 5.0 / 3.0), 1e-12);
}

// About one axis a rotation is as good as its angle.
TEST(RotationSpline, TurnsAboutOneAxisAreTheSplineOfTheAngle) {
  const std::vector<double> knots{1, 15, 30, 40, 60};
  const std::vector<double> angles{0, 1.2, 2.9, 2.9, 1.5};
  const Eigen::Vector3d axis = Eigen::Vector3d(1, -2, 0.5).normalized();
  std::vector<Eigen::Quaterniond> rotations;
  for (const double angle : angles) rotations.emplace_back(Eigen::AngleAxisd(angle, axis));
  const RestingSpline angle(knots, angles);
  const RotationSpline rotation(knots, rotations);
  for (double t = 0; t <= 62; t += 0.1) {
    const Eigen::Quaterniond expected(Eigen::AngleAxisd(angle.Value(t), axis));
    EXPECT_LT(rotation.Value(t).angularDistance(expected), 1e-9) << t;
  }
}

TEST(RotationSpline, IsContinuousWithItsFirstDerivativeAndTakesTheShorterWay) {
  std::vector<Eigen::Quaterniond> keys{
      FromRollPitchYaw({0, 0, 170}), FromRollPitchYaw({0, 0, -170}),
      FromRollPitchYaw({40, -30, -120}), FromRollPitchYaw({-60, 20, -60})};
  keys[1].coeffs() = -keys[1].coeffs();  // the same rotation
  const RotationSpline spline({0, 10, 30, 40}, keys);
  for (std::size_t i = 0; i < keys.size(); ++i) {
    EXPECT_LT(spline.Value(std::array{0.0, 10.0, 30.0, 40.0}[i]).angularDistance(keys[i]), 1e-7);
  }
  constexpr double kStep = 1e-3;
  const auto velocity = [&](double t) {
    return Eigen::Vector3d(ToRotationVector(spline.Value(t).conjugate() * spline.Value(t + kStep)) /
                           kStep);
  };
  // From 170 to -170 degrees is a turn of 20, never faster than 1.5 of 2 degrees a unit... times
  // the slope that the next chord asks for: far below the 34 degrees a unit of the long way round.
  for (double t = 0; t < 10; t += 0.1) EXPECT_LT(velocity(t).norm(), 6 * M_PI / 180);
  for (const double knot : {10.0, 30.0}) {
    EXPECT_LT((velocity(knot + kStep) - velocity(knot - 2 * kStep)).norm(), 2e-3) << knot;
  }
  EXPECT_LT(velocity(0).norm(), 1e-3);
  EXPECT_LT(velocity(40 - kStep).norm(), 1e-3);
}

TEST(Keyframes, AnObjectRestsBeforeAndAfterAndIsThereAtItsKeys) {
  const auto config = ParseSceneConfig(R"(name = "k"
purpose = "Keys."
frames = 60
rate_hz = 30
[camera]
width = 64
height = 48
f = 50
cx = 32
cy = 24
target = [0, 0, 0.74]
azimuth_deg = [-100, -80]
radius_m = [1.2, 1.2]
height_m = [0.8, 0.8]
[[object]]
name = "cube"
id = 3
class = "block"
model = "cube"
x = 0.1
y = -0.2
yaw_deg = 30
keyframe = [
  { frame = 10 },
  { frame = 20, position = [0.1, -0.2, 0.9] },
  { frame = 40, position = [0.3, 0.0, 0.9], rpy_deg = [0, 90, 0] },
  { frame = 50, quaternion = [0, 0, 1, 0] },
]
)",
                                       "k.toml");
  ASSERT_TRUE(config.has_value()) << config.error().message;
  const SceneMotion motion = MotionOf(*config);
  const auto at = [&](double frame) { return motion.T_WO(frame).at(3); };
  const Pose start = config->objects[0].T_WO();
  EXPECT_TRUE(start.translation().isApprox(Eigen::Vector3d(0.1, -0.2, kTableTop_m)));
  for (const int frame : {1, 5, 10}) EXPECT_TRUE(at(frame).isApprox(start, 1e-12)) << frame;
  EXPECT_TRUE(at(20).linear().isApprox(start.linear(), 1e-12));
  EXPECT_NEAR(at(20).translation().z(), 0.9, 1e-12);
  // While it is lifted it does not move sideways, while it is carried it keeps its height.
  for (int frame = 10; frame <= 20; ++frame) EXPECT_NEAR(at(frame).translation().x(), 0.1, 1e-12);
  for (int frame = 20; frame <= 40; ++frame) EXPECT_NEAR(at(frame).translation().z(), 0.9, 1e-12);
  // A pitch of 90 degrees turns the front (+x) down.
  EXPECT_TRUE(at(40).linear().col(0).isApprox(Eigen::Vector3d(0, 0, -1), 1e-9));
  EXPECT_TRUE(at(50).linear().col(0).isApprox(Eigen::Vector3d(-1, 0, 0), 1e-9));
  EXPECT_TRUE(at(60).isApprox(at(50), 1e-12));
  // Fractions of frames lie between their neighbours.
  EXPECT_GT(at(15.5).translation().z(), at(15).translation().z());
  EXPECT_LT(at(15.5).translation().z(), at(16).translation().z());
}

}  // namespace
}  // namespace tsdfpp
