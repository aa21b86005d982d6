#include "metrics/surface_samples.h"

#include <gtest/gtest.h>

#include <map>
#include <numeric>

#include "metrics/mesh_tools.h"
#include "metrics/surface_index.h"
#include "tests/metrics/test_scenes.h"

namespace tsdfpp {
namespace {

double TotalArea(const SampleSet& samples) {
  return std::accumulate(samples.area_m2.begin(), samples.area_m2.end(), 0.0);
}

TEST(SurfaceSamples, CountAreaAndNormals) {
  const TriangleMesh box = testing::Box({0, 0, 0}, {0.2F, 0.3F, 0.1F});
  const SampleSet samples = SampleMesh(box, 4, 1);
  const double area = SurfaceArea(box);
  EXPECT_NEAR(area, 0.22, 1e-7);
  EXPECT_EQ(samples.size(), 8800U);
  EXPECT_NEAR(TotalArea(samples), area, 1e-6);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const Eigen::Vector3f expected =
        AreaVector(box, samples.triangle[i]).normalized().cast<float>();
    ASSERT_NEAR((samples.normals[i] - expected).norm(), 0, 1e-6);
  }
}

// The estimator's floor: equal surfaces are 0 apart, whatever the density.
TEST(SurfaceSamples, FloorOfTheDistanceIsZero) {
  const TriangleMesh sphere = testing::Sphere(0.5F);
  const SampleSet samples = SampleMesh(sphere, 0.5, 1);
  const NearestSurface nearest = SurfaceIndex(sphere).Nearest(samples.points);
  for (const float distance : nearest.distance_m) ASSERT_LT(distance, 1e-6F);
}

// Two huge triangles: 4 samples a cm^2 leave no square of 1.5 cm without one, and counts in squares
// of 5 cm vary far less than those of independent samples would.
TEST(SurfaceSamples, StratifiedWithinLargeTriangles) {
  const SampleSet samples = SampleMesh(testing::Sheet({0, 0, 0}, {1, 0, 0}, {0, 1, 0}), 4, 1);
  ASSERT_EQ(samples.size(), 40000U);
  const auto counts = [&](double cell_m) {
    std::map<std::pair<int, int>, int> cells;
    for (const auto& p : samples.points) {
      ++cells[{static_cast<int>(p.x() / cell_m), static_cast<int>(p.y() / cell_m)}];
    }
    return cells;
  };
  constexpr int kSmallCells = 66 * 66;
  int filled = 0;
  for (const auto& [cell, count] : counts(0.015)) {
    if (cell.first < 66 && cell.second < 66) ++filled;
  }
  EXPECT_EQ(filled, kSmallCells);
  double squares = 0;
  const auto cells = counts(0.05);
  for (const auto& [cell, count] : cells) squares += (count - 100) * (count - 100);
  // Poisson: 100.
  EXPECT_LT(squares / static_cast<double>(cells.size()), 30);
}

// Long thin triangles and a huge one get their share of the area.
TEST(SurfaceSamples, AreaWeighted) {
  TriangleMesh mesh = testing::Sheet({0, 0, 0}, {1, 0, 0}, {0, 1, 0});
  testing::Append(mesh, testing::Sheet({3, 0, 0}, {0.5F, 0, 0}, {0, 0.5F, 0}, 20));
  const SampleSet samples = SampleMesh(mesh, 1, 5);
  const auto right = std::count_if(samples.points.begin(), samples.points.end(),
                                   [](const auto& p) { return p.x() > 2; });
  EXPECT_NEAR(static_cast<double>(right), 2500, 1);
}

TEST(SurfaceSamples, SeedDecides) {
  const TriangleMesh sphere = testing::Sphere(0.2F);
  const SampleSet a = SampleMesh(sphere, 1, 1);
  EXPECT_EQ(a.points, SampleMesh(sphere, 1, 1).points);
  EXPECT_NE(a.points, SampleMesh(sphere, 1, 2).points);
  EXPECT_NE(a.points, SampleMesh(sphere, 1, 1, 1).points);
}

TEST(SurfaceSamples, DensityByRegion) {
  TrueModel model = testing::Model(kBackground, testing::Sheet({0, 0, 0}, {1, 0, 0}, {0, 1, 0}));
  model.regions = {"floor", "table", "unused"};
  model.face_region = {0, 1};
  const SampleSet samples = SampleModel(model, SampleConfig{});
  const auto table = std::count(samples.region.begin(), samples.region.end(), 1);
  const auto floor = std::count(samples.region.begin(), samples.region.end(), 0);
  EXPECT_EQ(table, 20000);
  EXPECT_EQ(floor, 1250);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    ASSERT_EQ(samples.region[i], model.face_region[samples.triangle[i]]);
  }
  model.info.id = 3;
  EXPECT_EQ(SampleModel(model, SampleConfig{}).size(), 40000U) << "all of an object is fine";
}

TEST(SurfaceSamples, NothingFromNoArea) {
  TriangleMesh mesh;
  mesh.vertices = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}};
  mesh.triangles = {{0, 1, 2}};
  EXPECT_EQ(SampleMesh(mesh, 4, 1).size(), 0U);
  EXPECT_EQ(SampleMesh(TriangleMesh{}, 4, 1).size(), 0U);
}

// Two unit boxes that overlap by half: a quarter of each one's six faces is inside the other (half
// of four faces, and one whole face).
TEST(SurfaceSamples, InnerFacesOfOverlappingPartsAreLeftOut) {
  TriangleMesh mesh = testing::Box({0, 0, 0}, {1, 1, 1});
  testing::Append(mesh, testing::Box({0.5F, -0.25F, -0.25F}, {1.5F, 1.25F, 1.25F}));
  constexpr double kPerCm2 = 0.2;
  const SampleSet all = SampleMesh(mesh, kPerCm2, 1);
  const Solid solid(mesh);
  const SampleSet outer = WithoutInner(all, solid);
  double area = 0;
  for (std::size_t i = 0; i < outer.size(); ++i) {
    area += outer.area_m2[i];
    const Eigen::Vector3f& p = outer.points[i];
    const Eigen::Vector3f& n = outer.normals[i];
    const bool of_first = p.x() < 0.5F - 1e-6F;
    const bool of_second =
        std::abs(n.x()) > 0.5F || p.y() < 0 || p.y() > 1 || p.z() < 0 || p.z() > 1;
    EXPECT_TRUE(of_first || of_second) << p.transpose();
  }
  // Of the first box 1 + 4 x 0.5 is outside; of the second 2 x 2.25 + 4 x 1.5, less the 1 m^2 of
  // its face at x = 0.5 that is inside the first. A sample stands for 5 cm^2; only those on the
  // seams are in doubt.
  constexpr double kSeams_m2 = 0.02;
  EXPECT_NEAR(area, 1 + 2 + 4.5 + 6 - 1, kSeams_m2);
}

}  // namespace
}  // namespace tsdfpp
