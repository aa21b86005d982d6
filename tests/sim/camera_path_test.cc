// The camera's paths against what they are defined by, and against a real recording.
#include "sim/config/camera_path.h"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "core/files.h"
#include "tests/core/temp_folder.h"
#include "tests/needs.h"
#include "tests/sim/scene_files.h"

namespace tsdfpp {
namespace {

constexpr std::uint64_t kPathSeed = 5;

CameraMotion MotionOf(const CameraConfig& config, int frames, double rate_hz = 30) {
  auto motion = CameraMotion::Make(config, frames, rate_hz, kPathSeed);
  EXPECT_TRUE(motion.has_value()) << motion.error().message;
  return std::move(motion.value());
}

// The image's middle shows the target, its rows are level.
void ExpectLooksAt(const Pose& T_WC, const Eigen::Vector3d& target_W) {
  const Eigen::Vector3d p_C = T_WC.inverse() * target_W;
  EXPECT_GT(p_C.z(), 0);
  EXPECT_LT(p_C.head<2>().norm(), 1e-9);
  EXPECT_NEAR(T_WC.linear()(2, 0), 0, 1e-12);
  EXPECT_LT(T_WC.linear()(2, 1), 0) << "y points down";
  EXPECT_NEAR(T_WC.linear().determinant(), 1, 1e-12);
}

TEST(CameraPath, AnOrbitIsACircle) {
  const Eigen::Vector3d target(0.1, -0.05, 0.7);
  const CameraMotion motion = MotionOf({OrbitPath{target, 20, -0.5, 1.3, 0.6}, {}}, 91);
  for (int frame = 1; frame <= 91; ++frame) {
    const Pose T_WC = motion.T_WC(frame);
    ExpectLooksAt(T_WC, target);
    const double azimuth = (20 - 180.0 * (frame - 1) / 90) * M_PI / 180;
    const Eigen::Vector3d expected(0.1 + 1.3 * std::cos(azimuth), -0.05 + 1.3 * std::sin(azimuth),
                                   kTableTop_m + 0.6);
    EXPECT_LT((T_WC.translation() - expected).norm(), 1e-12) << frame;
  }
}

TEST(CameraPath, ASplinePassesItsKeysSmoothly) {
  SplinePath path;
  path.keys = {{5, {-1, -1, 1.4}, {0, 0, 0.7}},
               {40, {0, -1.2, 1.5}, {0.1, 0, 0.7}},
               {80, {1, -0.9, 1.3}, {0, 0.1, 0.8}}};
  const CameraMotion motion = MotionOf({path, {}}, 90);
  for (const CameraKey& key : path.keys) {
    EXPECT_LT((motion.T_WC(key.frame).translation() - key.position_W).norm(), 1e-12);
    ExpectLooksAt(motion.T_WC(key.frame), key.target_W);
  }
  EXPECT_EQ(motion.T_WC(1).matrix(), motion.T_WC(5).matrix());
  EXPECT_EQ(motion.T_WC(90).matrix(), motion.T_WC(80).matrix());
  constexpr double kLargestBend_m = 1e-3;  // change of the step, within the path
  for (int frame = 7; frame < 79; ++frame) {
    const auto at = [&](int f) -> Eigen::Vector3d { return motion.T_WC(f).translation(); };
    EXPECT_LT((at(frame + 1) - 2 * at(frame) + at(frame - 1)).norm(), kLargestBend_m) << frame;
  }
}

// Jitter has the stated size and frequencies; the path below it is taken off.
TEST(CameraPath, JitterHasItsStatedSizeAndBand) {
  const OrbitPath base{{0, 0, 0.7}, 0, 0, 1, 0.5};
  HandJitter jitter;
  jitter.position_mm = 4;
  jitter.rotation_deg = 0.5;
  jitter.lowest_hz = 1;
  jitter.highest_hz = 5;
  constexpr int kFrames = 3000;  // 100 seconds
  constexpr double kRate_hz = 30;
  const CameraMotion still = MotionOf({base, {}}, kFrames, kRate_hz);
  const CameraMotion shaken = MotionOf({base, jitter}, kFrames, kRate_hz);
  std::vector<std::vector<double>> signal(6);
  for (int frame = 1; frame <= kFrames; ++frame) {
    const Pose T_CJ = still.T_WC(frame).inverse() * shaken.T_WC(frame);
    const Eigen::Vector3d turn = ToRotationVector(Eigen::Quaterniond(T_CJ.linear()));
    for (int k = 0; k < 3; ++k) {
      signal[static_cast<std::size_t>(k)].push_back(T_CJ.translation()[k] * 1e3);
      signal[static_cast<std::size_t>(k) + 3].push_back(turn[k] * 180 / M_PI);
    }
  }
  for (std::size_t axis = 0; axis < 6; ++axis) {
    const double wanted = axis < 3 ? jitter.position_mm : jitter.rotation_deg;
    double power = 0;
    for (const double s : signal[axis]) power += s * s / kFrames;
    // Waves of a period that does not divide the 100 seconds leave a remainder of some per cent.
    EXPECT_NEAR(std::sqrt(power), wanted, 0.05 * wanted) << axis;
    // The share of the power at frequencies outside the band, by a plain Fourier sum.
    double inside = 0;
    double outside = 0;
    for (int cycles = 1; cycles < kFrames / 2; cycles += 1) {
      std::complex<double> sum = 0;
      for (int i = 0; i < kFrames; i += 1) {
        sum += signal[axis][static_cast<std::size_t>(i)] *
               std::polar(1.0, -2 * M_PI * cycles * i / kFrames);
      }
      const double hz = cycles * kRate_hz / kFrames;
      constexpr double kLeak_hz = 0.1;  // a wave between two lines of the spectrum spreads
      (hz < jitter.lowest_hz - kLeak_hz || hz > jitter.highest_hz + kLeak_hz ? outside : inside) +=
          std::norm(sum);
    }
    EXPECT_LT(outside, 0.02 * (inside + outside)) << axis;
  }
  // Another seed shakes otherwise, the same seed the same.
  const auto other = CameraMotion::Make({base, jitter}, kFrames, kRate_hz, kPathSeed + 1);
  EXPECT_FALSE(other->T_WC(7).isApprox(shaken.T_WC(7), 1e-6));
  EXPECT_EQ(MotionOf({base, jitter}, kFrames, kRate_hz).T_WC(7).matrix(), shaken.T_WC(7).matrix());
}

// The recording is a real one; what stays of it is its relative motion.
TEST(CameraPath, ARecordingKeepsItsRelativeMotion) {
  const std::string file = test::CopiedData("evo_tum/freiburg1_xyz-groundtruth.txt");
  // Read here by hand.
  std::ifstream in(file);
  std::vector<std::pair<double, Pose>> lines;
  for (std::string line; std::getline(in, line);) {
    std::istringstream words(line);
    double t = 0;
    Eigen::Vector3d p;
    Eigen::Quaterniond q;
    if (!(words >> t >> p.x() >> p.y() >> p.z() >> q.x() >> q.y() >> q.z() >> q.w())) continue;
    lines.emplace_back(t, Eigen::Translation3d(p) * q.normalized());
  }
  ASSERT_GT(lines.size(), 10U);
  const double length_s = lines.back().first - lines.front().first;
  // A rate at which frame k falls on a line's time: the line `step` lines on.
  const std::size_t step = lines.size() / 4;
  const double rate_hz = 1 / (lines[step].first - lines[0].first);
  const int frames = static_cast<int>(length_s * rate_hz) + 1;
  RecordedPath path{file, 0, {0, -1, 1.4}, {0, 0, 0.7}};
  const CameraMotion motion = MotionOf({path, {}}, frames, rate_hz);
  ExpectLooksAt(motion.T_WC(1), path.target_W);
  EXPECT_LT((motion.T_WC(1).translation() - path.position_W).norm(), 1e-12);
  const Pose moved = motion.T_WC(1).inverse() * motion.T_WC(2);
  const Pose expected = lines[0].second.inverse() * lines[step].second;
  EXPECT_LT((moved.translation() - expected.translation()).norm(), 1e-6);
  EXPECT_LT(
      Eigen::Quaterniond(moved.linear()).angularDistance(Eigen::Quaterniond(expected.linear())),
      1e-5);
  EXPECT_GT(expected.translation().norm(), 1e-3) << "the recording does not move: a poor test";

  const auto late = CameraMotion::Make({path, {}}, frames + 1000, rate_hz, kPathSeed);
  ASSERT_FALSE(late.has_value());
  EXPECT_EQ(late.error().kind, ErrorKind::kData);
  EXPECT_NE(late.error().message.find("groundtruth.txt: lasts"), std::string::npos)
      << late.error().message;
}

TEST(CameraPath, AnUnusableRecordingIsNamed) {
  const test::TempFolder folder;
  const auto file = folder / "bad_trajectory.txt";
  const std::vector<std::pair<std::string, std::string>> faults{
      {"", "has 0 poses, expected two at least"},
      {"1 0 0 0 0 0 0 1\n", "has 1 poses, expected two at least"},
      {"1 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1\n", ":2: the time 1 is not after the one before it"},
      {"# time\nx 0 0 0 0 0 0 1\n", ":2: 'x' is not a time"},
      {"1 0 0 0 0 0 1\n", ":1: '"},
      {"1 0 0 0 0 0 0 2\n", "the quaternion's length is 2.0"},
  };
  for (const auto& [text, sentence] : faults) {
    ASSERT_TRUE(WriteFile(file, text).has_value());
    const auto motion = CameraMotion::Make(
        {RecordedPath{file.string(), 0, {0, -1, 1.4}, {0, 0, 0}}, {}}, 2, 30, kPathSeed);
    ASSERT_FALSE(motion.has_value()) << text;
    EXPECT_EQ(motion.error().kind, ErrorKind::kData);
    EXPECT_NE(motion.error().message.find(sentence), std::string::npos) << motion.error().message;
  }
}

}  // namespace
}  // namespace tsdfpp
