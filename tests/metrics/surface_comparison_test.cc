#include "metrics/surface_comparison.h"

#include <gtest/gtest.h>

#include "core/ply.h"
#include "metrics/mesh_tools.h"
#include "metrics/point_index.h"
#include "metrics/surface_floor.h"
#include "metrics/surface_samples.h"
#include "tests/metrics/reference_files.h"
#include "tests/metrics/test_scenes.h"

namespace tsdfpp {
namespace {

SurfaceComparison Compare(const TriangleMesh& reconstruction, const TriangleMesh& truth,
                          SurfaceComparisonConfig config = {}) {
  auto result = CompareSurfaces(reconstruction, "ours", truth, "truth", false, config);
  EXPECT_TRUE(result) << result.error().message;
  return result ? *std::move(result) : SurfaceComparison{};
}

std::string ErrorOf(const TriangleMesh& reconstruction, const TriangleMesh& truth,
                    bool scale_is_given = false) {
  const auto result = CompareSurfaces(reconstruction, "ours", truth, "truth", scale_is_given, {});
  return result ? std::string() : result.error().message;
}

TriangleMesh Moved(TriangleMesh mesh, const Pose& T) {
  mesh.vertices = TransformPoints(T, mesh.vertices);
  return mesh;
}

// scipy's numbers (double precision on the stored floats), and trimesh's to the mesh.
TEST(SurfaceComparison, EqualsScipy) {
  const std::filesystem::path folder = test::CopiedData("geometry");
  const auto reference = testing::ReadJson(folder / "pointcloud_expected.json");
  const auto& expected = reference["cases"]["mustard"];
  const auto ours = ReadPly(folder / "mustard_pred_points.ply");
  const auto truth = ReadPly(folder / "mustard_gt_points.ply");
  ASSERT_TRUE(ours && truth);
  SurfaceComparisonConfig config;
  config.thresholds_m = {0.001, 0.002, 0.003, 0.005, 0.01};
  const SurfaceComparison result = Compare(*ours, *truth, config);
  constexpr double kDouble_m = 1e-12;
  const auto expect = [&](const DirectedDistances& distances, const nlohmann::json& numbers) {
    EXPECT_NEAR(distances.mean_m, numbers["mean"], kDouble_m);
    EXPECT_NEAR(distances.median_m, numbers["median"], kDouble_m);
    EXPECT_NEAR(distances.rmse_m, numbers["rmse"], kDouble_m);
    EXPECT_NEAR(distances.largest_m, numbers["max"], kDouble_m);
    EXPECT_NEAR(distances.p90_m, numbers["p90"], kDouble_m);
    EXPECT_FALSE(distances.to_triangles);
  };
  EXPECT_EQ(result.accuracy.samples, expected["n_pred"].get<std::size_t>());
  EXPECT_EQ(result.completeness.samples, expected["n_gt"].get<std::size_t>());
  expect(result.accuracy, expected["accuracy_pred_to_gtpoints"]);
  expect(result.completeness, expected["completeness_gtpoints_to_pred"]);
  EXPECT_NEAR(result.chamfer_sum_m, expected["chamfer_sum_of_means"], kDouble_m);
  EXPECT_NEAR(result.chamfer_mean_m, expected["chamfer_mean_of_means"], kDouble_m);
  EXPECT_NEAR(result.chamfer_squared_m2, expected["chamfer_squared_sum"], kDouble_m);
  EXPECT_NEAR(result.hausdorff_m, expected["hausdorff"], kDouble_m);
  for (std::size_t k = 0; k < config.thresholds_m.size(); ++k) {
    const auto& at = expected[fmt::format("threshold_{:.0f}mm", 1e3 * config.thresholds_m[k])];
    EXPECT_NEAR(result.accuracy.within[k], at["precision"], kDouble_m);
    EXPECT_NEAR(result.completeness.within[k], at["recall"], kDouble_m);
    EXPECT_NEAR(result.f_score[k], at["fscore"], kDouble_m);
  }
  EXPECT_FALSE(result.facing_away.value);
  EXPECT_EQ(result.floors.accuracy_m.value, SamplingFloor_m(*truth).value);

  TSDFPP_NEEDS_SHARED("meshes/ycb_ccby4");
  const TriangleMesh mesh =
      testing::ReadObj(test::SharedData("meshes/ycb_ccby4/YcbMustardBottle.obj"));
  const SurfaceComparison to_mesh = Compare(*ours, mesh, config);
  EXPECT_TRUE(to_mesh.accuracy.to_triangles);
  const auto& numbers = expected["accuracy_pred_to_gtmesh"];
  // trimesh looks among candidate triangles and misses the nearest for some points: see
  // geometry_references_test.cc.
  constexpr double kTrimesh_m = 5e-7;
  EXPECT_NEAR(to_mesh.accuracy.mean_m, numbers["mean"], kTrimesh_m);
  EXPECT_NEAR(to_mesh.accuracy.median_m, numbers["median"], kTrimesh_m);
  EXPECT_NEAR(to_mesh.accuracy.rmse_m, numbers["rmse"], kTrimesh_m);
  EXPECT_NEAR(to_mesh.accuracy.largest_m, numbers["max"], kTrimesh_m);
  EXPECT_NEAR(to_mesh.accuracy.p90_m, numbers["p90"], kTrimesh_m);
  EXPECT_EQ(*to_mesh.floors.accuracy_m.value, 0);
}

TEST(SurfaceComparison, OffsetPlane) {
  const TriangleMesh truth = testing::Sheet({-1, -1, 0}, {2, 0, 0}, {0, 2, 0});
  const SurfaceComparison result =
      Compare(testing::Sheet({-1, -1, 0.007F}, {2, 0, 0}, {0, 2, 0}, 10), truth);
  for (const DirectedDistances* side : {&result.accuracy, &result.completeness}) {
    EXPECT_NEAR(side->mean_m, 0.007, testing::kFloat_m);
    EXPECT_NEAR(side->median_m, 0.007, testing::kFloat_m);
    EXPECT_NEAR(side->rmse_m, 0.007, testing::kFloat_m);
    EXPECT_NEAR(side->p95_m, 0.007, testing::kFloat_m);
    EXPECT_NEAR(side->largest_m, 0.007, testing::kFloat_m);
    EXPECT_EQ(side->within, (std::vector<double>{0, 1, 1}));
    EXPECT_EQ(side->samples, 160'000U);
    EXPECT_NEAR(*side->samples_per_cm2.value, 4, 1e-6);
  }
  EXPECT_NEAR(result.chamfer_sum_m, 0.014, testing::kFloat_m);
  EXPECT_NEAR(result.chamfer_mean_m, 0.007, testing::kFloat_m);
  EXPECT_NEAR(result.chamfer_squared_m2, 2 * 0.007 * 0.007, 1e-8);
  EXPECT_NEAR(result.hausdorff_m, 0.007, testing::kFloat_m);
  EXPECT_EQ(result.f_score, (std::vector<double>{0, 1, 1}));
  EXPECT_EQ(*result.facing_recall[1].value, 1);
  EXPECT_EQ(*result.facing_away.value, 0);
  EXPECT_TRUE(result.remarks.empty());
}

TEST(SurfaceComparison, InflatedSphere) {
  const SurfaceComparison result =
      Compare(testing::Sphere(0.103F, 128), testing::Sphere(0.1F, 128));
  // Facets of 1.4 deg: both stray by some r a^2 / 24 = 3 um inwards.
  EXPECT_NEAR(result.accuracy.mean_m, 0.003, 5e-6);
  EXPECT_NEAR(result.completeness.mean_m, 0.003, 1e-5);
  EXPECT_LT(*result.floors.truth_facets_m.value, 1e-5);
}

// Half the truth: precision 1, recall a half (and tau's width), the far edge half a metre away.
TEST(SurfaceComparison, HalfAMesh) {
  SurfaceComparisonConfig config;
  config.thresholds_m = {0.01};
  const TriangleMesh truth = testing::Sheet({0, 0, 0}, {1, 0, 0}, {0, 1, 0});
  const SurfaceComparison result =
      Compare(testing::Sheet({0, 0, 0}, {0.5F, 0, 0}, {0, 1, 0}), truth, config);
  EXPECT_EQ(result.accuracy.within[0], 1);
  EXPECT_NEAR(result.completeness.within[0], 0.51, 1e-3);
  EXPECT_NEAR(result.f_score[0], 2 * 0.51 / 1.51, 1e-3);
  EXPECT_NEAR(result.completeness.mean_m, 0.125, 1e-4);
  EXPECT_NEAR(result.completeness.p90_m, 0.4, 1e-3);
  // The truth's own corner is asked too, so the bound is exact.
  EXPECT_NEAR(result.hausdorff_m, 0.5, testing::kFloat_m);
  EXPECT_NEAR(result.accuracy.largest_m, 0, testing::kFloat_m);
  EXPECT_NEAR(result.floors.recall_error, 0.5 / std::sqrt(40'000.0), 1e-9);
  EXPECT_NEAR(result.floors.precision_error, 0.5 / std::sqrt(20'000.0), 1e-9);
}

// A box moved by 3 cm along x: the two faces across x are 3 cm off, of each other four the last 3
// cm stick out by up to that.
TEST(SurfaceComparison, ShiftedCopy) {
  SurfaceComparisonConfig config;
  config.thresholds_m = {0.001};
  const TriangleMesh box = testing::Box({0, 0, 0}, {0.3F, 0.3F, 0.3F});
  const SurfaceComparison result =
      Compare(Moved(box, Pose(Eigen::Translation3d(0.03, 0, 0))), box, config);
  EXPECT_NEAR(result.hausdorff_m, 0.03, testing::kFloat_m);
  // Four faces keep 0.27 m (and tau) of their 0.3 m. (Inside, the moved face meets the others at
  // its rim, a tau wide.)
  const double rim = (0.3 * 0.3 - 0.298 * 0.298) / 0.09;
  EXPECT_NEAR(result.accuracy.within[0], (4 * 0.271 / 0.3 + rim) / 6, 2e-3);
  EXPECT_NEAR(result.completeness.within[0], result.accuracy.within[0], 2e-3);
}

// A known hole of 20 x 20 cm in a square metre.
TEST(SurfaceComparison, AHoleIsItsArea) {
  SurfaceComparisonConfig config;
  config.thresholds_m = {0.0005};
  TriangleMesh frame = testing::Sheet({0, 0, 0}, {1, 0, 0}, {0, 0.4F, 0});
  testing::Append(frame, testing::Sheet({0, 0.6F, 0}, {1, 0, 0}, {0, 0.4F, 0}));
  testing::Append(frame, testing::Sheet({0, 0.4F, 0}, {0.4F, 0, 0}, {0, 0.2F, 0}));
  testing::Append(frame, testing::Sheet({0.6F, 0.4F, 0}, {0.4F, 0, 0}, {0, 0.2F, 0}));
  const SurfaceComparison result =
      Compare(frame, testing::Sheet({0, 0, 0}, {1, 0, 0}, {0, 1, 0}), config);
  EXPECT_NEAR(result.completeness.within[0], 1 - 0.199 * 0.199, 1e-3);
  EXPECT_EQ(result.accuracy.within[0], 1);
  EXPECT_NEAR(result.completeness.largest_m, 0.1, 0.005);
}

// A planted sheet of 30 x 30 cm, 10 cm above a square metre: precision loses its share.
TEST(SurfaceComparison, APlantedGhostIsItsArea) {
  const TriangleMesh truth = testing::Sheet({0, 0, 0}, {1, 0, 0}, {0, 1, 0});
  TriangleMesh ours = truth;
  testing::Append(ours, testing::Sheet({0.2F, 0.2F, 0.1F}, {0.3F, 0, 0}, {0, 0.3F, 0}));
  const SurfaceComparison result = Compare(ours, truth);
  EXPECT_NEAR(result.accuracy.within.back(), 1 / 1.09, 1e-3);
  EXPECT_EQ(result.completeness.within.back(), 1);
  EXPECT_NEAR(result.accuracy.largest_m, 0.1, testing::kFloat_m);
}

TEST(SurfaceComparison, FlippedFacesAreSaid) {
  const TriangleMesh truth = testing::Box({0, 0, 0}, {0.3F, 0.3F, 0.3F});
  TriangleMesh flipped = truth;
  testing::Flip(flipped);
  const SurfaceComparison result = Compare(flipped, truth);
  EXPECT_EQ(result.completeness.within[0], 1);
  EXPECT_LT(*result.facing_recall[0].value, 0.1);
  EXPECT_GT(*result.facing_away.value, 0.9);
  ASSERT_EQ(result.remarks.size(), 1U);
  EXPECT_NE(result.remarks[0].find("flipped"), std::string::npos);
}

TEST(SurfaceComparison, NoOverlapIsSaid) {
  const TriangleMesh truth = testing::Box({0, 0, 0}, {0.3F, 0.3F, 0.3F});
  SurfaceComparison result = Compare(Moved(truth, Pose(Eigen::Translation3d(5, 0, 0))), truth);
  EXPECT_EQ(result.f_score.back(), 0);
  EXPECT_NEAR(result.hausdorff_m, 5, 1e-5);
  ASSERT_EQ(result.remarks.size(), 1U);
  EXPECT_NE(result.remarks[0].find("do not overlap: their boxes are 4.7 m apart"),
            std::string::npos)
      << result.remarks[0];
  EXPECT_FALSE(result.facing_away.value);
  // One within the other, nowhere near.
  result = Compare(testing::Box({0.1F, 0.1F, 0.1F}, {0.2F, 0.2F, 0.2F}), truth);
  ASSERT_EQ(result.remarks.size(), 1U);
  EXPECT_NE(result.remarks[0].find("no sample of ours is within 0.02 m of truth"),
            std::string::npos);
  // Kilometres away the distances are right as well.
  result = Compare(Moved(truth, Pose(Eigen::Translation3d(0, 5000, 0))), truth);
  EXPECT_NEAR(result.accuracy.mean_m, 5000, 0.5);
}

TEST(SurfaceComparison, UnusableSurfacesAreRefused) {
  const TriangleMesh box = testing::Box({0, 0, 0}, {0.3F, 0.3F, 0.3F});
  EXPECT_EQ(ErrorOf({}, box), "ours: holds no vertices, expected a surface or points");
  EXPECT_EQ(ErrorOf(box, {}), "truth: holds no vertices, expected a surface or points");
  TriangleMesh bad = box;
  bad.vertices[3].y() = NAN;
  EXPECT_EQ(ErrorOf(bad, box), "ours: a vertex has no finite x, y, z");
  TriangleMesh flat;
  flat.vertices = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}};
  flat.triangles = {{0, 1, 2}};
  EXPECT_EQ(ErrorOf(flat, box), "ours: has 1 faces but none of them has an area");
}

TEST(SurfaceComparison, AnotherUnitIsRefusedUnlessTheScaleIsGiven) {
  const TriangleMesh box = testing::Box({0, 0, 0}, {0.3F, 0.3F, 0.3F});
  const TriangleMesh millimetres = testing::Box({0, 0, 0}, {300, 300, 300});
  EXPECT_EQ(ErrorOf(millimetres, box),
            "ours: measures 300 x 300 x 300 m, but truth 0.3 x 0.3 x 0.3 m: is it in another unit? "
            "Give its scale (--scale 0.001 would fit, --scale 1 takes it as it is)");
  EXPECT_NE(ErrorOf(box, millimetres).find("--scale 1e+03"), std::string::npos)
      << ErrorOf(box, millimetres);
  EXPECT_EQ(ErrorOf(millimetres, box, true), "");
  // A small part of a room is no other unit.
  EXPECT_EQ(ErrorOf(box, testing::Box({0, 0, 0}, {6, 6, 3})), "");
}

TEST(SurfaceComparison, SamplesAreCapped) {
  SurfaceComparisonConfig config;
  config.max_samples = 5000;
  const TriangleMesh sheet = testing::Sheet({0, 0, 0}, {1, 0, 0}, {0, 1, 0});
  const SurfaceComparison result = Compare(sheet, sheet, config);
  EXPECT_EQ(result.accuracy.samples, 5000U);
  EXPECT_NEAR(*result.accuracy.samples_per_cm2.value, 0.5, 1e-6);
}

// Two samplings of one surface read their floor, 0.5 / sqrt(density).
TEST(SurfaceFloor, OfPointsIsWhatEqualSurfacesRead) {
  TriangleMesh cloud;
  cloud.vertices = testing::RandomPoints(20'000, {0, 0, 0}, {1, 1, 0}, 1);
  TriangleMesh other;
  other.vertices = testing::RandomPoints(20'000, {0, 0, 0}, {1, 1, 0}, 2);
  const double expected = 0.5 / std::sqrt(20'000.0);
  // The spacings' standard error is 0.4 % of it, and the rim's points have fewer neighbours.
  EXPECT_NEAR(*SamplingFloor_m(cloud).value, expected, 0.02 * expected);
  const SurfaceComparison result = Compare(cloud, other);
  EXPECT_NEAR(result.accuracy.mean_m, *result.floors.accuracy_m.value, 0.02 * expected);
  EXPECT_NEAR(result.completeness.mean_m, *result.floors.completeness_m.value, 0.02 * expected);
  cloud.vertices.resize(1);
  EXPECT_FALSE(SamplingFloor_m(cloud).value);
}

TEST(SurfaceFloor, OfFacetsIsTheirDistanceFromTheSphere) {
  for (const int rings : {8, 16, 64}) {
    const TriangleMesh sphere = testing::Sphere(0.1F, rings);
    const SampleSet samples = SampleMesh(sphere, 40, 1);
    double stray = 0;
    for (const auto& point : samples.points) stray += 0.1 - point.cast<double>().norm();
    stray /= static_cast<double>(samples.size());
    // Second order in the edges: of 22 deg with 8 rings.
    EXPECT_NEAR(*TessellationFloor_m(sphere).value, stray, 0.05 * stray) << rings;
  }
}

TEST(SurfaceFloor, FlatFacesAndCreasesHaveNone) {
  EXPECT_NEAR(*TessellationFloor_m(testing::Box({0, 0, 0}, {1, 1, 1}, 5)).value, 0, 1e-8);
  EXPECT_NEAR(*TessellationFloor_m(testing::Sheet({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, 5)).value, 0,
              1e-9);
  EXPECT_FALSE(TessellationFloor_m({}).value);
  // Faces that share no vertices but lie at one place are neighbours (STL).
  const TriangleMesh sphere = testing::Sphere(0.1F, 16);
  TriangleMesh soup;
  for (std::size_t t = 0; t < sphere.triangles.size(); ++t) {
    for (int k = 0; k < 3; ++k) soup.vertices.push_back(Corner(sphere, t, k));
    const auto first = static_cast<std::uint32_t>(3 * t);
    soup.triangles.push_back({first, first + 1, first + 2});
  }
  EXPECT_NEAR(*TessellationFloor_m(soup).value, *TessellationFloor_m(sphere).value, 1e-9);
}

TEST(SurfaceFloor, RoundingIsHalfAnUlp) {
  TriangleMesh mesh;
  mesh.vertices = {{0, 0, 0}, {-1024, 3, 4}};
  EXPECT_DOUBLE_EQ(RoundingFloor_m(mesh), 1024 * std::pow(2.0, -24));
}

// Each of them once would take minutes.
TEST(PointIndex, ManyEqualPointsAreOne) {
  const std::vector<Eigen::Vector3f> points(300'000, Eigen::Vector3f(1, 2, 3));
  const PointIndex index(points);
  for (const double distance : index.Distances_m(points)) ASSERT_EQ(distance, 0);
  for (const double spacing : index.Spacings_m()) ASSERT_EQ(spacing, 0);
}

TEST(PointIndex, EqualsBruteForce) {
  auto points = testing::RandomPoints(3000, {0, 0, 0}, {1, 0.2F, 1}, 4);
  points.push_back(points[7]);
  const auto queries = testing::RandomPoints(500, {-0.5F, -0.5F, -0.5F}, {1.5F, 1.5F, 1.5F}, 5);
  const PointIndex index(points);
  const auto distances = index.Distances_m(queries);
  const auto brute = [&](const Eigen::Vector3f& q, std::size_t except) {
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < points.size(); ++i) {
      if (i == except) continue;
      least = std::min(least, (points[i].cast<double>() - q.cast<double>()).norm());
    }
    return least;
  };
  for (std::size_t i = 0; i < queries.size(); ++i) {
    ASSERT_DOUBLE_EQ(distances[i], brute(queries[i], points.size()));
  }
  const auto spacings = index.Spacings_m();
  for (std::size_t i = 0; i < points.size(); ++i) {
    ASSERT_DOUBLE_EQ(spacings[i], brute(points[i], i));
  }
  EXPECT_EQ(spacings[7], 0) << "a point that is there twice";
  EXPECT_TRUE(std::isinf(PointIndex({}).Distances_m(queries)[0]));
}

}  // namespace
}  // namespace tsdfpp
