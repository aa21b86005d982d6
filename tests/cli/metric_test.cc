// `tsdfpp metric` on files, as a user calls it: the numbers of other programs, and bad inputs.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "core/ply.h"
#include "tests/cli/metric_runner.h"
#include "tests/core/temp_folder.h"
#include "tests/metrics/test_scenes.h"
#include "tests/needs.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;
using test::CommandOutput;
using test::kData;
using test::kUsage;
using test::RunTsdfpp;
using test::TempFolder;

class Metric : public test::MetricRunner {};

TEST_F(Metric, TrajectoryPrintsEvosNumbers) {
  const fs::path evo = test::CopiedData("evo_tum");
  std::ifstream file(evo / "expected_evo.json");
  const auto expected = nlohmann::json::parse(file)["freiburg1_xyz-rgbdslam.txt"];
  const auto json = Json({"trajectory", evo / "freiburg1_xyz-groundtruth.txt",
                          evo / "freiburg1_xyz-rgbdslam.txt", "--align", "sim3", "--delta", "1f"});
  constexpr double kEvoDigits = 1e-8;
  EXPECT_EQ(json["pairs"], expected["matched_pairs"]);
  EXPECT_NEAR(json["alignment"]["scale"], expected["align_sim3"]["s"], kEvoDigits);
  for (const auto& [key, value] : expected["ape_trans_sim3"].items()) {
    EXPECT_NEAR(json["ape"]["translation_m"][key], value, kEvoDigits) << key;
  }
  // Not aligned, every delta.
  const auto plain = Json({"trajectory", evo / "freiburg1_xyz-groundtruth.txt",
                           evo / "freiburg1_xyz-rgbdslam.txt", "--delta", "1f,10f,0.1m"});
  EXPECT_TRUE(plain["alignment"].is_null());
  EXPECT_NEAR(plain["ape"]["translation_m"]["rmse"], expected["ape_trans_none"]["rmse"],
              kEvoDigits);
  const std::array<const char*, 3> keys = {"rpe_trans_delta1frames", "rpe_trans_delta10frames",
                                           "rpe_trans_delta0.1m"};
  for (std::size_t k = 0; k < keys.size(); ++k) {
    EXPECT_NEAR(plain["rpe"][k]["translation_m"]["rmse"], expected[keys[k]]["rmse"], kEvoDigits);
    EXPECT_EQ(plain["rpe"][k]["stretches"], expected[keys[k]]["n"]);
  }
}

// As in TUM's own fr2/desk: a time stands twice, with poses 4 cm apart, and another time twice with
// one pose. TUM's tools take the last line of a time, and evo 1.38 does, where the estimate is
// later (tests/data/README.md has the commands). The first line would give an ATE of 10.6 mm.
TEST_F(Metric, TrajectoryReadsATimeThatStandsTwiceAsOthersDo) {
  const fs::path folder = test::CopiedData("double_stamps");
  const fs::path truth = folder / "groundtruth.txt";
  const fs::path estimate = folder / "estimate.txt";
  const auto plain = Json({"trajectory", truth, estimate, "--delta", "1f,0.3s"});
  const std::string remark =
      truth.string() +
      ": lines that repeat the time of an earlier one: 2, 1 of them with another pose, the first "
      "is line 26 (time 1311868164.8892); of a time the last line counts";
  EXPECT_EQ(plain["remarks"], nlohmann::json::array({remark}));
  EXPECT_NE(err_.find(remark), std::string::npos) << err_;
  EXPECT_EQ(plain["pairs"], 20);
  constexpr double kEvoDigits = 1e-8;
  EXPECT_NEAR(plain["ape"]["translation_m"]["rmse"], 0.00755857129357129, kEvoDigits);
  EXPECT_NEAR(plain["ape"]["translation_m"]["max"], 0.010780074211247213, kEvoDigits);
  EXPECT_NEAR(plain["ape"]["rotation_deg"]["rmse"], 0.6753040480294638, 1e-6);
  EXPECT_NEAR(plain["rpe"][0]["translation_m"]["rmse"], 0.010245992063398615, kEvoDigits);
  constexpr double kPrinted = 5.01e-7;  // six decimals, by evaluate_rpe.py and evaluate_ate.py
  EXPECT_EQ(plain["rpe"][1]["stretches"], 15);
  EXPECT_NEAR(plain["rpe"][1]["translation_m"]["rmse"], 0.011379, kPrinted);
  EXPECT_NEAR(plain["rpe"][1]["rotation_deg"]["rmse"], 0.985386, kPrinted);
  const auto aligned = Json({"trajectory", truth, estimate, "--align", "se3"});
  EXPECT_NEAR(aligned["ape"]["translation_m"]["rmse"], 0.007203, kPrinted);
  EXPECT_NEAR(aligned["ape"]["translation_m"]["max"], 0.010408, kPrinted);
}

TEST_F(Metric, TrajectoryRefusesWhatItCannotUse) {
  const std::string truth = Write("truth.txt", "0 0 0 0 0 0 0 1\n1 1 0 0 0 0 0 1\n");
  const std::string late = Write("late.txt", "100 0 0 0 0 0 0 1\n101 1 0 0 0 0 0 1\n");
  ExpectError({"trajectory", truth, folder_ / "none.txt"}, kData, {"none.txt"});
  ExpectError({"trajectory", truth, late}, kData, {"late.txt", "none of its 2 poses", "clock"});
  ExpectError({"trajectory", truth, Write("bad.txt", "0 0 0 nan 0 0 0 1\n")}, kData, {"bad.txt:1"});
  ExpectError({"trajectory", truth, Write("empty.txt", "# nothing\n")}, kData, {"empty.txt"});
  ExpectError({"trajectory", truth, truth, "--align", "sim4"}, kUsage, {"sim4"});
  for (const char* delta : {"0f", "1.5f", "1x", "-1m", "nanm", ","}) {
    ExpectError({"trajectory", truth, truth, fmt::format("--delta={}", delta)}, kUsage,
                {"--delta"});
  }
  for (const char* delta : {"0.2m", "1s", "0.2m,1s"}) {
    ExpectError({"trajectory", truth, truth, "--delta", delta, "--all-pairs"}, kUsage,
                {"--all-pairs", fmt::format("'{}' has no stretch of frames", delta)});
  }
  Json({"trajectory", truth, truth, "--delta", "0.2m,1f", "--all-pairs"});
  // Too short for an alignment: null with a reason.
  const auto json = Json({"trajectory", truth, truth, "--align", "se3", "--delta", "5f"});
  EXPECT_TRUE(json["ape"]["translation_m"]["value"].is_null());
  EXPECT_EQ(json["ape"]["translation_m"]["why"], "an alignment needs 3 pairs of poses, found 2");
  EXPECT_TRUE(json["rpe"][0]["rotation_deg"]["value"].is_null());
}

TEST_F(Metric, SurfacePrintsScipysNumbers) {
  const fs::path geometry = test::CopiedData("geometry");
  std::ifstream file(geometry / "pointcloud_expected.json");
  const auto expected = nlohmann::json::parse(file)["cases"]["mustard"];
  const auto json = Json({"surface", geometry / "mustard_pred_points.ply",
                          geometry / "mustard_gt_points.ply", "--tau", "0.01,0.001"});
  constexpr double kDouble = 1e-12;
  EXPECT_NEAR(json["accuracy"]["mean_m"], expected["accuracy_pred_to_gtpoints"]["mean"], kDouble);
  EXPECT_NEAR(json["chamfer_sum_m"], expected["chamfer_sum_of_means"], kDouble);
  EXPECT_NEAR(json["hausdorff_m"], expected["hausdorff"], kDouble);
  EXPECT_EQ(json["at"][0]["tau_m"], 0.001) << "in order";
  EXPECT_NEAR(json["at"][0]["f_score"], expected["threshold_1mm"]["fscore"], kDouble);
  EXPECT_NEAR(json["at"][1]["recall"], expected["threshold_10mm"]["recall"], kDouble);
  EXPECT_TRUE(json["facing_away"]["value"].is_null());
  EXPECT_GT(json["floors"]["accuracy_m"], 0.0);
  EXPECT_EQ(err_, "");
}

// A box of 30 cm and its copy 4 mm larger on all sides, in every format.
TEST_F(Metric, SurfaceReadsEveryFormat) {
  const TriangleMesh box = testing::Box({0, 0, 0}, {0.3F, 0.3F, 0.3F});
  std::string obj;
  std::string stl = "solid box\n";
  for (const auto& v : box.vertices) obj += fmt::format("v {} {} {}\n", v.x(), v.y(), v.z());
  for (const auto& t : box.triangles) {
    obj += fmt::format("f {} {} {}\n", t[0] + 1, t[1] + 1, t[2] + 1);
    stl += "facet normal 0 0 0\nouter loop\n";
    for (const std::uint32_t v : t) {
      const auto& p = box.vertices[v];
      stl += fmt::format("vertex {} {} {}\n", p.x(), p.y(), p.z());
    }
    stl += "endloop\nendfacet\n";
  }
  stl += "endsolid box\n";
  const std::string larger =
      WriteMesh("larger.ply", testing::Box({-0.004F, -0.004F, -0.004F}, {0.304F, 0.304F, 0.304F}));
  for (const std::string& truth :
       {WriteMesh("box.ply", box), Write("box.obj", obj), Write("box.stl", stl)}) {
    const auto json = Json({"surface", larger, truth});
    // Exactly 4 mm but for the rims, which are up to 4 sqrt(3) mm off.
    EXPECT_NEAR(json["accuracy"]["median_m"], 0.004, 1e-6) << truth;
    EXPECT_NEAR(json["completeness"]["max_m"], 0.004, 1e-6) << truth;
    EXPECT_NEAR(json["hausdorff_m"], 0.004 * std::sqrt(3), 1e-6) << truth;
    EXPECT_EQ(json["facing_away"], 0) << truth;
    EXPECT_TRUE(json["remarks"].empty());
  }
}

TEST_F(Metric, SurfaceSaysWhatIsWrong) {
  const TriangleMesh box = testing::Box({0, 0, 0}, {0.3F, 0.3F, 0.3F});
  const std::string truth = WriteMesh("truth.ply", box);
  const std::string in_mm = WriteMesh("in_mm.ply", testing::Box({0, 0, 0}, {300, 300, 300}));
  ExpectError({"surface", in_mm, truth}, kData, {"in_mm.ply", "--scale 0.001"});
  EXPECT_NEAR(Json({"surface", in_mm, truth, "--scale", "0.001"})["hausdorff_m"], 0, 1e-6);
  EXPECT_NEAR(Json({"surface", in_mm, truth, "--scale", "1"})["hausdorff_m"], std::sqrt(3) * 299.7,
              0.01);

  const char* const ascii =
      "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float "
      "z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n";
  ExpectError({"surface",
               Write("nan.ply", fmt::format("{}0 0 0\n1 nan 0\n0 1 0\n3 0 1 2\n", ascii)), truth},
              kData, {"nan.ply", "finite"});
  ExpectError({"surface", WriteMesh("empty.ply", {}), truth}, kData, {"empty.ply", "no vertices"});
  ExpectError({"surface", Write("half.ply", fmt::format("{}0 0 0\n", ascii)), truth}, kData,
              {"half.ply"});
  ExpectError({"surface", Write("mesh.xyz", "0 0 0\n"), truth}, kUsage, {"mesh.xyz", ".ply"});
  ExpectError({"surface", truth, truth, "--tau", "0.01,-1"}, kUsage, {"--tau", "-1"});
  ExpectError({"surface", truth, truth, "--tau", ","}, kUsage, {"--tau"});
  ExpectError({"surface", truth, truth, "--scale", "0"}, kUsage, {"--scale"});

  // Sound numbers, and a remark: elsewhere, and inside out.
  TriangleMesh other = box;
  for (auto& vertex : other.vertices) vertex.x() += 2;
  auto json = Json({"surface", WriteMesh("elsewhere.ply", other), truth});
  EXPECT_EQ(json["at"][0]["precision"], 0);
  ASSERT_EQ(json["remarks"].size(), 1U);
  EXPECT_NE(err_.find("do not overlap"), std::string::npos) << err_;
  other = box;
  testing::Flip(other);
  json = Json({"surface", WriteMesh("flipped.ply", other), truth});
  EXPECT_EQ(json["at"][0]["recall"], 1);
  EXPECT_NE(err_.find("flipped"), std::string::npos) << err_;
}

std::string PoseLine(double stamp_s, const nlohmann::json& R, const nlohmann::json& t) {
  Eigen::Matrix3d rotation;
  for (Eigen::Index r = 0; r < 3; ++r) {
    for (Eigen::Index c = 0; c < 3; ++c) {
      rotation(r, c) = R[static_cast<std::size_t>(r)][static_cast<std::size_t>(c)];
    }
  }
  const Eigen::Quaterniond q(rotation);
  return fmt::format("{} {} {} {} {} {} {} {}\n", stamp_s, t[0].get<double>(), t[1].get<double>(),
                     t[2].get<double>(), q.x(), q.y(), q.z(), q.w());
}

TEST_F(Metric, PosePrintsBopToolkitsNumbers) {
  const fs::path geometry = test::CopiedData("geometry");
  std::ifstream file(geometry / "bop_pose_errors.json");
  const auto cases = nlohmann::json::parse(file)["cases"];
  std::string truth;
  std::string estimate;
  double add = 0;
  double left = 0;
  for (std::size_t k = 0; k < cases.size(); ++k) {
    truth += PoseLine(static_cast<double>(k), cases[k]["R_gt"], cases[k]["t_gt"]);
    estimate += PoseLine(static_cast<double>(k), cases[k]["R_est"], cases[k]["t_est"]);
    add += cases[k]["add"].get<double>() / 6;
    left += (1 - cases[k]["add"].get<double>() / 0.1) / 6;
  }
  // And one true pose without an estimate.
  truth += "60 0 0 1 0 0 0 1\n";
  const auto json =
      Json({"pose", geometry / "mustard_model_points.ply", Write("ref.txt", truth),
            Write("est.txt", estimate), "--camera", "525,525,319.5,239.5", "--symmetry", "z:180"});
  EXPECT_EQ(json["found"], 6);
  EXPECT_EQ(json["reference_poses"], 7);
  ASSERT_EQ(json["frames"].size(), 6U);
  // Rotations go through text.
  constexpr double kText = 1e-7;
  for (std::size_t k = 0; k < cases.size(); ++k) {
    const auto& frame = json["frames"][k];
    EXPECT_NEAR(frame["add_m"], cases[k]["add"], kText);
    EXPECT_NEAR(frame["add_s_m"], cases[k]["adi"], kText);
    EXPECT_NEAR(frame["mssd_m"], cases[k]["mssd_rotz180"], kText);
    EXPECT_NEAR(frame["mspd_px"], cases[k]["mspd_rotz180"], 1e-4);
    EXPECT_NEAR(frame["translation_m"], cases[k]["te"], kText);
    EXPECT_NEAR(frame["rotation_deg"], cases[k]["re_deg"], 1e-5);
  }
  EXPECT_NEAR(json["mean"]["ADD_m"], add, kText);
  EXPECT_NEAR(json["auc_add"], left * 6 / 7, 1e-6) << "what was not found counts as lost";
}

TEST_F(Metric, PoseAnchorsAndRefuses) {
  const std::string model = WriteMesh("model.ply", testing::Box({0, 0, 0}, {0.1F, 0.1F, 0.1F}));
  const std::string truth = Write("truth.txt", "1 0 0 0 0 0 0 1\n2 1 0 0 0 0 0 1\n");
  // The mapper's object frame is half a metre aside, and it loses 10 cm on the way.
  const std::string estimate = Write("estimate.txt", "1 0 0.5 0 0 0 0 1\n2 0.9 0.5 0 0 0 0 1\n");
  EXPECT_NEAR(Json({"pose", model, truth, estimate})["mean"]["ADD_m"],
              (0.5 + std::hypot(0.5, 0.1)) / 2, 1e-6);
  const auto anchored = Json({"pose", model, truth, estimate, "--anchor"});
  EXPECT_NEAR(anchored["mean"]["ADD_m"], 0.05, 1e-6);
  EXPECT_NEAR(anchored["max"]["ADD_m"], 0.1, 1e-6);
  EXPECT_TRUE(anchored["mean"]["MSPD_px"]["value"].is_null());
  // One estimate finds one true pose, the nearest in time.
  const std::string close = Write("close.txt",
                                  "1.992 0 0 0 0 0 0 1\n1.996 0 0 0 0 0 0 1\n"
                                  "2 0 0 0 0 0 0 1\n");
  const auto once = Json({"pose", model, close, Write("one.txt", "1.997 0 0.1 0 0 0 0 1\n")});
  EXPECT_EQ(once["found"], 1);
  EXPECT_EQ(once["frames"][0]["t"], 1.996);
  ExpectError({"pose", model, truth, Write("late.txt", "9 0 0 0 0 0 0 1\n")}, kData, {"late.txt"});
  ExpectError({"pose", WriteMesh("none.ply", {}), truth, estimate}, kData, {"none.ply"});
  ExpectError({"pose", model, truth, estimate, "--camera", "1,2,3"}, kUsage, {"--camera"});
  ExpectError({"pose", model, truth, estimate, "--symmetry", "w:180"}, kUsage, {"--symmetry"});
}

// The third estimate lies behind the camera, where MSPD says nothing: the worst of all, and in
// neither its mean nor its max.
TEST_F(Metric, PoseSaysOfHowManyItsMeansAre) {
  const std::string model = WriteMesh("model.ply", testing::Box({0, 0, 0}, {0.1F, 0.1F, 0.1F}));
  const std::string truth =
      Write("truth.txt", "1 0 0 1 0 0 0 1\n2 0 0 1 0 0 0 1\n3 0 0 1 0 0 0 1\n");
  const std::string estimate =
      Write("estimate.txt", "1 0 0 1 0 0 0 1\n2 0 0 1 0 0 0 1\n3 0 0 -1 0 0 0 1\n");
  const auto json = Json({"pose", model, truth, estimate, "--camera", "525,525,319.5,239.5"});
  EXPECT_EQ(json["defined"]["MSPD_px"], 2);
  EXPECT_EQ(json["defined"]["MSSD_m"], 3);
  const std::string remark =
      "MSPD is undefined at 1 of 3 estimates, which its mean and max lack, the first at 3 s: a "
      "point of the model lies behind the camera";
  EXPECT_EQ(json["remarks"], nlohmann::json::array({remark}));
  EXPECT_NE(err_.find(remark), std::string::npos) << err_;
  const CommandOutput text =
      Run({"pose", model, truth, estimate, "--camera", "525,525,319.5,239.5"});
  EXPECT_NE(text.out.find("px (of 2 of 3)\n"), std::string::npos) << text.out;
  EXPECT_TRUE(Json({"pose", model, truth, estimate})["remarks"].empty());
}

TEST_F(Metric, NamesWhatIsNoSubcommand) {
  ExpectError({}, kUsage, {"subcommand"});
  ExpectError({"frobnicate"}, kUsage, {"frobnicate"});
  const CommandOutput help = Run({"surface", "--help"});
  EXPECT_EQ(help.exit_code, 0);
  EXPECT_NE(help.out.find("--tau"), std::string::npos);
}

}  // namespace
}  // namespace tsdfpp
