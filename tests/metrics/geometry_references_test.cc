// Against numbers that other programs made (tests/data/README.md): trimesh.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "core/ply.h"
#include "metrics/accuracy.h"
#include "metrics/mesh_tools.h"
#include "tests/metrics/reference_files.h"
#include "tests/metrics/test_scenes.h"
#include "tests/reference/brute_force_distance.h"

namespace tsdfpp {
namespace {

using testing::ReadObj;
const std::filesystem::path kGeometry = test::CopiedData("geometry");

TEST(GeometryReferences, AreasEqualTrimesh) {
  TSDFPP_NEEDS_SHARED("meshes/ycb_ccby4");
  const auto expected = testing::ReadJson(kGeometry / "mesh_properties.json");
  int compared = 0;
  for (const auto& [name, properties] : expected["meshes"].items()) {
    if (!name.ends_with(".obj")) continue;
    const double area = properties["area"];
    // Single-precision vertices.
    EXPECT_NEAR(SurfaceArea(ReadObj(test::SharedData("meshes") / name)), area, 1e-5 * area) << name;
    ++compared;
  }
  EXPECT_GE(compared, 5);
}

TEST(GeometryReferences, AccuracyToTheSurfaceEqualsTrimesh) {
  TSDFPP_NEEDS_SHARED("meshes/ycb_ccby4");
  const auto expected =
      testing::ReadJson(kGeometry / "pointcloud_expected.json")["cases"]["mustard"];
  const auto cloud = ReadPly(kGeometry / "mustard_pred_points.ply");
  ASSERT_TRUE(cloud) << cloud.error().message;
  SampleSet samples;
  samples.points = cloud->vertices;
  samples.area_m2.assign(samples.points.size(), 1);
  ASSERT_EQ(samples.size(), expected["n_pred"].get<std::size_t>());

  const TruthSurface truth(
      testing::Model(1, ReadObj(test::SharedData("meshes/ycb_ccby4/YcbMustardBottle.obj"))));
  const std::array<double, 5> thresholds_m = {0.001, 0.002, 0.003, 0.005, 0.01};
  const AccuracyScores scores =
      ScoreAccuracy(samples, {&truth, Pose::Identity()}, std::nullopt, thresholds_m);
  // trimesh looks among candidate triangles and misses the nearest for some points: its mean is
  // 0.3 um above the exact one (double precision, every triangle), which ours equals.
  constexpr double kTrimesh_m = 5e-7;
  constexpr double kMean_m = 1e-8;
  const auto& distances = expected["accuracy_pred_to_gtmesh"];
  EXPECT_NEAR(*scores.distance.mean_m.value, distances["mean"], kTrimesh_m);
  EXPECT_NEAR(*scores.distance.rmse_m.value, distances["rmse"], kTrimesh_m);
  double sum = 0;
  for (const auto& point : samples.points) {
    sum += reference::DistanceToMesh(point, truth.model().mesh_O, [](std::size_t) { return true; });
  }
  EXPECT_NEAR(*scores.distance.mean_m.value, sum / 3846, kMean_m);
  for (std::size_t k = 0; k < thresholds_m.size(); ++k) {
    const auto& at =
        expected["threshold_" + std::to_string(std::lround(1e3 * thresholds_m[k])) + "mm"];
    // One point in 3,846 may lie within rounding of a threshold.
    EXPECT_NEAR(*scores.precision[k].value, at["precision_to_mesh"], 1.0 / 3846 + 1e-9);
  }
}

}  // namespace
}  // namespace tsdfpp
