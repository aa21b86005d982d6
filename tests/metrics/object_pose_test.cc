#include "metrics/object_pose.h"

#include <gtest/gtest.h>

#include <numbers>

#include "core/ply.h"
#include "metrics/trajectory.h"
#include "tests/metrics/reference_files.h"
#include "tests/metrics/test_scenes.h"

namespace tsdfpp {
namespace {

constexpr double kAddsFloat_m = 1e-7;  // ADD-S runs in single precision

const Intrinsics kBopCamera{640, 480, 525, 525, 319.5, 239.5};

TEST(ObjectPose, EqualsBopToolkit) {
  const std::filesystem::path folder = test::CopiedData("geometry");
  const auto expected = testing::ReadJson(folder / "bop_pose_errors.json");
  const auto cloud = ReadPly(folder / "mustard_model_points.ply");
  ASSERT_TRUE(cloud) << cloud.error().message;
  ASSERT_EQ(expected["K"][0][0], kBopCamera.fx);
  ASSERT_EQ(expected["K"][1][2], kBopCamera.cy);
  const std::array half_turn = {
      Pose(Eigen::AngleAxisd(std::numbers::pi, Eigen::Vector3d::UnitZ()))};
  constexpr double kDouble = 1e-9;
  constexpr double kPixels = 1e-6;
  ASSERT_EQ(expected["cases"].size(), 6U);
  for (const auto& pair : expected["cases"]) {
    const Pose estimate = testing::PoseOf(pair["R_est"], pair["t_est"]);
    const Pose truth = testing::PoseOf(pair["R_gt"], pair["t_gt"]);
    const auto& points = cloud->vertices;
    EXPECT_NEAR(*AddError_m(points, estimate, truth).value, pair["add"], kDouble);
    EXPECT_NEAR(*AddSymmetricError_m(points, estimate, truth).value, pair["adi"], kAddsFloat_m);
    EXPECT_NEAR(*Mssd_m(points, estimate, truth).value, pair["mssd_nosym"], kDouble);
    EXPECT_NEAR(*Mssd_m(points, estimate, truth, half_turn).value, pair["mssd_rotz180"], kDouble);
    EXPECT_NEAR(*Mspd_px(points, estimate, truth, kBopCamera).value, pair["mspd_nosym"], kPixels);
    EXPECT_NEAR(*Mspd_px(points, estimate, truth, kBopCamera, half_turn).value,
                pair["mspd_rotz180"], kPixels);
    const PosePairs pairs = {{0}, {estimate}, {truth}};
    EXPECT_NEAR(TranslationErrors_m(pairs)[0], pair["te"], kDouble);
    EXPECT_NEAR(RotationErrors_rad(pairs)[0] * 180 / std::numbers::pi, pair["re_deg"], 1e-6);
  }
}

// The corners of a square of 20 cm, half a turn about z: ADD is the way each goes, ADD-S none.
class Square : public ::testing::Test {
 protected:
  const std::vector<Eigen::Vector3f> points_{
      {0.1F, 0.1F, 0}, {-0.1F, 0.1F, 0}, {-0.1F, -0.1F, 0}, {0.1F, -0.1F, 0}};
  const Pose truth_{Eigen::Translation3d(0, 0, 1)};
  const Pose turned_ = truth_ * Pose(Eigen::AngleAxisd(std::numbers::pi, Eigen::Vector3d::UnitZ()));
};

// The axis of a symmetry turns with the object.
TEST_F(Square, ASymmetryIsOfTheObject) {
  const std::array half_turn = {
      Pose(Eigen::AngleAxisd(std::numbers::pi, Eigen::Vector3d::UnitZ()))};
  const Pose upright = truth_ * Pose(Eigen::AngleAxisd(1.2, Eigen::Vector3d::UnitX()));
  EXPECT_NEAR(*Mssd_m(points_, upright * half_turn[0], upright, half_turn).value, 0, kAddsFloat_m);
}

TEST_F(Square, HalfATurn) {
  EXPECT_NEAR(*AddError_m(points_, turned_, truth_).value, std::sqrt(0.08), kAddsFloat_m);
  EXPECT_NEAR(*AddSymmetricError_m(points_, turned_, truth_).value, 0, kAddsFloat_m);
  EXPECT_NEAR(*Mssd_m(points_, turned_, truth_).value, std::sqrt(0.08), kAddsFloat_m);
  const std::array symmetries = {
      Pose(Eigen::AngleAxisd(std::numbers::pi / 2, Eigen::Vector3d::UnitZ())),
      Pose(Eigen::AngleAxisd(std::numbers::pi, Eigen::Vector3d::UnitZ()))};
  EXPECT_NEAR(*Mssd_m(points_, turned_, truth_, symmetries).value, 0, kAddsFloat_m);
  const Intrinsics camera{100, 100, 500, 500, 50, 50};
  EXPECT_NEAR(*Mspd_px(points_, turned_, truth_, camera).value, 500 * std::sqrt(0.08), 1e-4);
  EXPECT_NEAR(*Mspd_px(points_, turned_, truth_, camera, symmetries).value, 0, 1e-4);
}

TEST_F(Square, MovedAsideAndAway) {
  const Pose aside = Pose(Eigen::Translation3d(0.03, 0, 0)) * truth_;
  EXPECT_NEAR(*AddError_m(points_, aside, truth_).value, 0.03, kAddsFloat_m);
  EXPECT_NEAR(*AddSymmetricError_m(points_, aside, truth_).value, 0.03, kAddsFloat_m);
  EXPECT_NEAR(*Mssd_m(points_, aside, truth_).value, 0.03, kAddsFloat_m);
  // 0.03 m at 1 m, f 400 and 500 px.
  EXPECT_NEAR(*Mspd_px(points_, aside, truth_, {0, 0, 400, 500, 0, 0}).value, 12, 1e-4);
  const Pose below = Pose(Eigen::Translation3d(0, 0.03, 0)) * truth_;
  EXPECT_NEAR(*Mspd_px(points_, below, truth_, {0, 0, 400, 500, 0, 0}).value, 15, 1e-4);
  const Pose behind = Pose(Eigen::Translation3d(0, 0, -2)) * truth_;
  EXPECT_EQ(Mspd_px(points_, behind, truth_, kBopCamera).why_not,
            "a point of the model lies behind the camera");
}

// ADD-S asks from the true pose to the estimate: points far apart and together tell the sides
// apart.
TEST(ObjectPose, AddSIsFromTheTruthToTheEstimate) {
  const std::vector<Eigen::Vector3f> points = {{0, 0, 0}, {1, 0, 0}, {0.9F, 0, 0}};
  const Pose moved(Eigen::Translation3d(1, 0, 0));
  // The estimate's points are at 1, 2, 1.9; the truth's at 0, 1, 0.9: 1 + 0 + 0.1 from the truth.
  EXPECT_NEAR(*AddSymmetricError_m(points, moved, Pose::Identity()).value, 1.1 / 3, 1e-6);
  // From the estimate it would be 0 + 1 + 0.9.
}

TEST(AreaUnderCurve, IsTheMeanOfWhatIsLeft) {
  const auto auc = [](const std::vector<double>& errors, double greatest) {
    std::vector<Measured> measured;
    for (const double error : errors) measured.push_back(Measured::Of(error));
    return *AreaUnderCurve(measured, greatest).value;
  };
  EXPECT_DOUBLE_EQ(auc({0, 0}, 0.1), 1);
  EXPECT_DOUBLE_EQ(auc({0.05}, 0.1), 0.5);
  EXPECT_DOUBLE_EQ(auc({0.02, 0.3}, 0.1), 0.4);
  EXPECT_DOUBLE_EQ(auc({0.02}, 0.2), 0.9);
  // The curve itself, summed in steps of a micrometre.
  const std::vector<double> errors = {0.01, 0.037, 0.06, 0.2};
  double area = 0;
  constexpr int kSteps = 100'000;
  for (int i = 0; i < kSteps; ++i) {
    const double t = 0.1 * (i + 0.5) / kSteps;
    for (const double error : errors) area += error <= t ? 1.0 / 4 / kSteps : 0;
  }
  EXPECT_NEAR(auc(errors, 0.1), area, 1e-5);
  const std::array lost = {Measured::Of(0), Measured::Undefined("not found")};
  EXPECT_DOUBLE_EQ(*AreaUnderCurve(lost).value, 0.5);
  EXPECT_FALSE(AreaUnderCurve({}).value);
}

TEST(ObjectPose, WithoutPointsIsUndefined) {
  const Pose I = Pose::Identity();
  EXPECT_FALSE(AddError_m({}, I, I).value);
  EXPECT_FALSE(AddSymmetricError_m({}, I, I).value);
  EXPECT_FALSE(Mssd_m({}, I, I).value);
  EXPECT_EQ(Mspd_px({}, I, I, kBopCamera).why_not, "the model has no points");
}

}  // namespace
}  // namespace tsdfpp
