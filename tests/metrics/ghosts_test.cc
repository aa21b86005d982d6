#include "metrics/ghosts.h"

#include <gtest/gtest.h>

#include <numbers>

#include "metrics/solid.h"
#include "tests/metrics/test_scenes.h"

namespace tsdfpp {
namespace {

constexpr InstanceId kGhostTable = 1;
constexpr double kGhostTau_m = 0.01;

TEST(Solid, BoxHoldsWhatIsInIt) {
  const TriangleMesh box = testing::Box({0, 0, 0}, {1, 1, 1}, 8);
  const Solid solid(box);
  auto points = testing::RandomPoints(5000, {-0.5F, -0.5F, -0.5F}, {1.5F, 1.5F, 1.5F});
  // Points whose rays run exactly through edges and corners of the mesh.
  for (int x = 1; x < 8; ++x) {
    for (int y = 1; y < 8; ++y) {
      for (const float z : {-0.3F, 0.3F, 1.3F}) {
        points.emplace_back(static_cast<float>(x) / 8, static_cast<float>(y) / 8, z);
      }
    }
  }
  const auto inside = solid.Contains(points);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const bool expected = (points[i].array() > 0).all() && (points[i].array() < 1).all();
    ASSERT_EQ(inside[i] != 0, expected) << points[i].transpose();
  }
}

TEST(Solid, OverlappingPartsAndSphere) {
  TriangleMesh mesh = testing::Box({0, 0, 0}, {1, 1, 1});
  testing::Append(mesh, testing::Box({0.5F, 0.25F, 0.25F}, {1.5F, 0.75F, 0.75F}));
  const Solid solid(mesh);
  const std::vector<Eigen::Vector3f> points = {
      {0.75F, 0.5F, 0.5F}, {0.2F, 0.5F, 0.5F}, {1.2F, 0.5F, 0.5F}, {1.2F, 0.5F, 0.9F}};
  EXPECT_EQ(solid.Contains(points), (std::vector<std::uint8_t>{1, 1, 1, 0}));

  const TriangleMesh sphere = testing::Sphere(0.5F);
  const auto around = testing::RandomPoints(5000, {-0.6F, -0.6F, -0.6F}, {0.6F, 0.6F, 0.6F});
  const auto inside = Solid(sphere).Contains(around);
  for (std::size_t i = 0; i < around.size(); ++i) {
    // The facets lie up to 0.6 mm within the sphere.
    if (std::abs(around[i].norm() - 0.5F) < 0.001F) continue;
    ASSERT_EQ(inside[i] != 0, around[i].norm() < 0.5F);
  }
}

// All over one another, each as wide as the mesh: in a fine grid every column would list each.
TEST(Solid, ManySheetsAsWideAsTheMesh) {
  constexpr std::uint32_t kSheets = 70000;  // 2^32 entries in a grid of 256 x 256
  TriangleMesh mesh;
  for (std::uint32_t i = 0; i < kSheets; ++i) {
    const float z = 0.01F * static_cast<float>(i) / static_cast<float>(kSheets);
    for (const Eigen::Vector3f& corner :
         {Eigen::Vector3f(0, 0, z), Eigen::Vector3f(1, 0, z), Eigen::Vector3f(0, 1, z)}) {
      mesh.vertices.push_back(corner);
    }
    mesh.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
  }
  const std::vector<Eigen::Vector3f> points = {
      {0.2F, 0.2F, 0.1F}, {0.2F, 0.2F, -0.1F}, {0.2F, 0.2F, 0.005F}, {0.8F, 0.8F, -0.1F}};
  EXPECT_EQ(Solid(mesh).Contains(points), (std::vector<std::uint8_t>{0, 1, 1, 0}));
}

TEST(Solid, BelowAFloorSheetIsInside) {
  const TriangleMesh floor = testing::Sheet({0, 0, 0}, {1, 0, 0}, {0, 1, 0});
  const std::vector<Eigen::Vector3f> points = {{0.5F, 0.5F, 0.1F}, {0.5F, 0.5F, -0.1F}};
  EXPECT_EQ(Solid(floor).Contains(points), (std::vector<std::uint8_t>{0, 1}));
  EXPECT_EQ(Solid(TriangleMesh{}).Contains(points), (std::vector<std::uint8_t>{0, 0}));
}

Frame WallAt(double depth_m) {
  return testing::CastFrame([=](double, double) { return testing::Hit{depth_m, kGhostTable}; });
}

TEST(FreeSpace, TheLatestFrameThatSawThePointDecides) {
  const std::vector<Eigen::Vector3f> points = {{0, 0, 1}};
  const auto free = [&](const std::vector<double>& depths) {
    FreeSpace space;
    for (const double depth : depths) space.Observe(WallAt(depth));
    return space.ObservedFree(points, kGhostTau_m)[0] != 0;
  };
  EXPECT_FALSE(free({}));
  EXPECT_TRUE(free({2}));
  EXPECT_FALSE(free({0.5})) << "behind a surface";
  EXPECT_FALSE(free({1.005})) << "at a surface";
  EXPECT_FALSE(free({2, 1.005})) << "something came to stand there";
  EXPECT_TRUE(free({1.005, 2})) << "it left, and the camera saw that";
  EXPECT_TRUE(free({2, 0.5})) << "covered now, seen to be free before";
  EXPECT_FALSE(free({1.005, 0.5})) << "covered now, surface when last seen";
  EXPECT_TRUE(free({2, 0})) << "invalid depth tells nothing";
}

TEST(FreeSpace, OutsideTheImageAndBehindTheCameraIsNotObserved) {
  FreeSpace space;
  space.Observe(WallAt(2));
  const std::vector<Eigen::Vector3f> points = {{0.5F, 0, 1}, {0.55F, 0, 1}, {0, 0, -1}};
  EXPECT_EQ(space.ObservedFree(points, kGhostTau_m), (Selection{1, 0, 0}));
}

TEST(FreeSpace, DepthEdgesTellNothing) {
  FreeSpace space;
  // An edge at half a block.
  space.Observe(testing::CastFrame(
      [](double x, double) {
        return testing::Hit{x * 300 < 0 ? 0.5 : 2.0, kGhostTable};
      },
      {320, 240, 300, 300, 162, 120}));
  const std::vector<Eigen::Vector3f> points = {{0, 0, 1}, {0.02F, 0, 1}};
  EXPECT_EQ(space.ObservedFree(points, kGhostTau_m), (Selection{0, 1}));
}

// A table (slab from z = 2 to 2.1) seen from the origin, and a car at z = 1.5.
class GhostScene : public ::testing::Test {
 protected:
  GhostScene()
      : table_(testing::Model(kGhostTable, testing::Box({-1, -1, 2}, {1, 1, 2.1F}))),
        car_(testing::Model(2, testing::Box({-0.1F, -0.1F, -0.1F}, {0.1F, 0.1F, 0.1F}))) {
    space_.Observe(WallAt(2));
    T_W_car_.translation().z() = 1.5;
  }
  static TriangleMesh Plate(float z) {
    return testing::Sheet({-0.15F, -0.15F, z}, {0, 0.3F, 0}, {0.3F, 0, 0}, 30);
  }
  enum class Car { kNone, kThere, kRemoved };
  // Of a mesh of the table's top, 2 mm off, and these parts.
  GhostScores Score(const std::vector<TriangleMesh>& parts, Car car,
                    const GhostSampling& sampling = {}) const {
    TriangleMesh mesh = testing::Sheet({-1, -1, 2.002F}, {0, 2, 0}, {2, 0, 0}, 100);
    for (const auto& part : parts) testing::Append(mesh, part);
    std::vector<PlacedTruth> truths = {{&table_, Pose::Identity()}};
    std::vector<PlacedTruth> removed;
    if (car == Car::kThere) truths.push_back({&car_, T_W_car_});
    if (car == Car::kRemoved) removed.push_back({&car_, T_W_car_});
    return ScoreGhosts(mesh, truths, removed, kGhostTau_m, space_, sampling);
  }
  static AreaEstimate In(const GhostScores& scores, GhostSpace space) {
    return scores.space[static_cast<std::size_t>(space)];
  }

  TruthSurface table_;
  TruthSurface car_;
  Pose T_W_car_ = Pose::Identity();
  FreeSpace space_;
};

constexpr double kPlate_m2 = 0.09;
// Areas are sums of single-precision triangles of a square centimetre.
constexpr double kAreaRounding_m2 = 1e-7;
// Standard errors that an estimate may be off: one of 16,000 is farther off by chance, and seeds
// are fixed.
constexpr double kStandardErrors = 4;

TEST_F(GhostScene, WhatIsGhostAllOverHasNoError) {
  const GhostScores scores = Score({Plate(1.5F)}, Car::kNone);
  EXPECT_NEAR(scores.ghosts.area_m2, kPlate_m2, kAreaRounding_m2);
  EXPECT_EQ(scores.ghosts.standard_error_m2, 0);
  EXPECT_NEAR(*scores.share_of_mesh.value, kPlate_m2 / (4 + kPlate_m2), 1e-6);
  EXPECT_EQ(Score({}, Car::kNone).ghosts.area_m2, 0);
  EXPECT_EQ(Score({}, Car::kNone).samples.size(), 0U);
}

// A sheet that rises from the table at a right angle is a ghost from tau on; a single large quad
// has to be cut.
TEST_F(GhostScene, ASheetOnTheTableFromOneVoxelOn) {
  for (const int cells : {1, 3, 37}) {
    const auto sheet = testing::Sheet({0.2F, 0.2F, 1.8F}, {0.3F, 0, 0}, {0, 0, 0.2F}, cells);
    const GhostScores scores = Score({sheet}, Car::kNone);
    const double exact_m2 = 0.3 * (0.2 - kGhostTau_m);
    EXPECT_NEAR(scores.ghosts.area_m2, exact_m2, kStandardErrors * scores.ghosts.standard_error_m2)
        << cells;
    EXPECT_GT(scores.ghosts.standard_error_m2, 0) << cells;
    EXPECT_LT(scores.ghosts.standard_error_m2, 1e-4) << cells << ": a square centimetre";
  }
}

// Half of the sheet is within the image, half outside.
TEST_F(GhostScene, OnlyInObservedFreeSpace) {
  const double edge = 1.5 * 160 / 300;  // of the image, at z = 1.5
  const auto sheet =
      testing::Sheet({static_cast<float>(edge - 0.2), -0.1F, 1.5F}, {0, 0.2F, 0}, {0.4F, 0, 0}, 7);
  const GhostScores scores = Score({sheet}, Car::kNone);
  const AreaEstimate unseen = In(scores, GhostSpace::kUnseen);
  EXPECT_NEAR(scores.ghosts.area_m2, 0.04, kStandardErrors * scores.ghosts.standard_error_m2);
  EXPECT_NEAR(unseen.area_m2, 0.04, kStandardErrors * unseen.standard_error_m2);
  EXPECT_NEAR(scores.ghosts.area_m2 + unseen.area_m2, 0.08, kAreaRounding_m2);
  EXPECT_GT(unseen.standard_error_m2, 0);

  // 5 cm deep in the slab, and 40 cm below the table, where nobody looked.
  const GhostScores deep = Score({Plate(2.05F)}, Car::kNone);
  EXPECT_EQ(deep.ghosts.area_m2 + In(deep, GhostSpace::kUnseen).area_m2, 0);
  const GhostScores below = Score({Plate(2.5F)}, Car::kRemoved);
  EXPECT_EQ(below.ghosts.area_m2, 0);
  EXPECT_NEAR(In(below, GhostSpace::kUnseen).area_m2, kPlate_m2, kAreaRounding_m2);
}

// With the car at z = 1.5 its inside is no free space; after its removal the same surface is a
// ghost, and so is what is left of the car's own surface.
TEST_F(GhostScene, InsideACarUntilItIsRemoved) {
  const double rounded_m2 = (4 - std::numbers::pi) * kGhostTau_m * kGhostTau_m;
  const double outside_m2 = kPlate_m2 - 0.22 * 0.22 + rounded_m2;  // farther than tau from it
  const GhostScores there = Score({Plate(1.5F)}, Car::kThere);
  EXPECT_NEAR(there.ghosts.area_m2, outside_m2, kStandardErrors * there.ghosts.standard_error_m2);
  const GhostScores gone = Score({Plate(1.5F)}, Car::kRemoved);
  EXPECT_NEAR(gone.ghosts.area_m2, kPlate_m2, kAreaRounding_m2);
  const AreaEstimate vacated = In(gone, GhostSpace::kVacated);
  EXPECT_NEAR(vacated.area_m2, kPlate_m2 - outside_m2, kStandardErrors * vacated.standard_error_m2);
  EXPECT_NEAR(In(gone, GhostSpace::kSeenFree).area_m2, outside_m2,
              kStandardErrors * In(gone, GhostSpace::kSeenFree).standard_error_m2);
  // Its sides, 5 mm off: within tau of where it was, though every frame that saw it says surface.
  const auto side = testing::Sheet({-0.1F, -0.1F, 1.395F}, {0.2F, 0, 0}, {0, 0.2F, 0}, 20);
  EXPECT_NEAR(In(Score({side}, Car::kRemoved), GhostSpace::kVacated).area_m2, 0.04,
              kAreaRounding_m2);
  EXPECT_EQ(Score({side}, Car::kThere).ghosts.area_m2, 0);
}

// What the standard error says is what seeds show: 400 seeds tell a variance to 7 %, so a ratio
// within 1 +- 0.21 is within three standard errors of 1.
TEST_F(GhostScene, TheStandardErrorIsTheSpreadOverSeeds) {
  constexpr int kSeeds = 400;
  const double exact_m2 = 0.1 * (0.05 - kGhostTau_m);
  const auto sheet = testing::Sheet({0.2F, 0.2F, 1.95F}, {0.1F, 0, 0}, {0, 0, 0.05F}, 7);
  const std::vector<PlacedTruth> truths = {{&table_, Pose::Identity()}};
  // Two densities: the second is the cap's.
  for (const std::size_t most : {100'000U, 200U}) {
    double sum = 0;
    double squares = 0;
    double told = 0;
    for (int seed = 0; seed < kSeeds; ++seed) {
      const GhostSampling sampling{16, most, static_cast<std::uint64_t>(seed)};
      const auto ghosts = ScoreGhosts(sheet, truths, {}, kGhostTau_m, space_, sampling).ghosts;
      const double off = ghosts.area_m2 - exact_m2;
      sum += off;
      squares += off * off;
      told += ghosts.standard_error_m2 * ghosts.standard_error_m2;
    }
    const double mean = sum / kSeeds;
    const double variance = squares / kSeeds - mean * mean;
    EXPECT_NEAR(mean, 0, kStandardErrors * std::sqrt(variance / kSeeds)) << "biased";
    EXPECT_NEAR(variance / (told / kSeeds), 1, 0.21) << most;
  }
}

// Distance to a box's surface and whether the point is inside, by formula.
struct BoxSide {
  double distance_m = 0;
  bool inside = false;
};
BoxSide ToBox(const Eigen::Vector3d& point, const Eigen::Vector3d& low,
              const Eigen::Vector3d& high) {
  const Eigen::Vector3d beyond = (low - point).cwiseMax(point - high);
  if (beyond.maxCoeff() <= 0) return {-beyond.maxCoeff(), true};
  return {beyond.cwiseMax(0).norm(), false};
}

// Triangles of all sizes and ways, many of them about the surfaces, against a grid of points on
// each that are judged by formula.
TEST_F(GhostScene, AsBruteForceOnRandomTriangles) {
  constexpr std::size_t kTriangles = 150;
  constexpr int kCells = 200;  // a side: 40,000 points a triangle
  TriangleMesh mesh;
  const auto centres = testing::RandomPoints(kTriangles, {-0.6F, -0.6F, 1.3F}, {0.6F, 0.6F, 2.3F});
  const auto edges = testing::RandomPoints(3 * kTriangles, {-1, -1, -1}, {1, 1, 1}, 8);
  for (std::size_t t = 0; t < kTriangles; ++t) {
    const float size = 0.01F * static_cast<float>(1 + t % 30);
    Eigen::Vector3f centre = centres[t];
    if (t % 3 == 0) centre.z() = 2.0F;  // about the table's top
    if (t % 3 == 1) centre = 0.2F * centres[t] + Eigen::Vector3f(0, 0, 1.16F);  // about the car
    const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
    for (std::size_t k = 0; k < 3; ++k) mesh.vertices.push_back(centre + size * edges[3 * t + k]);
    mesh.triangles.push_back({first, first + 1, first + 2});
  }
  std::array<double, 3> exact_m2{};
  for (std::size_t t = 0; t < kTriangles; ++t) {
    const Eigen::Vector3d a = mesh.vertices[3 * t].cast<double>();
    const Eigen::Vector3d ab = mesh.vertices[3 * t + 1].cast<double>() - a;
    const Eigen::Vector3d ac = mesh.vertices[3 * t + 2].cast<double>() - a;
    const double cell_m2 = 0.5 * ab.cross(ac).norm() / (kCells * kCells);
    for (int i = 0; i < kCells; ++i) {
      for (int j = 0; j < 2 * (kCells - i) - 1; ++j) {
        // Centroids of the cells of row i, upright and upside down.
        const double third = j % 2 == 0 ? 1.0 / 3 : 2.0 / 3;
        const int column = j / 2;
        const Eigen::Vector3d p = a + ((i + third) * ab + (column + third) * ac) / kCells;
        const BoxSide table = ToBox(p, {-1, -1, 2}, {1, 1, 2.1});
        if (table.inside || table.distance_m <= kGhostTau_m) continue;
        const BoxSide car = ToBox(p, {-0.1, -0.1, 1.4}, {0.1, 0.1, 1.6});
        const bool in_image =
            std::abs(p.x() / p.z()) < 160.0 / 300 && std::abs(p.y() / p.z()) < 120.0 / 300;
        const GhostSpace space = car.inside || car.distance_m <= kGhostTau_m ? GhostSpace::kVacated
                                 : in_image && p.z() < 2 - kGhostTau_m       ? GhostSpace::kSeenFree
                                                                             : GhostSpace::kUnseen;
        exact_m2[static_cast<std::size_t>(space)] += cell_m2;
      }
    }
  }
  const GhostScores scores =
      ScoreGhosts(mesh, std::vector<PlacedTruth>{{&table_, Pose::Identity()}},
                  std::vector<PlacedTruth>{{&car_, T_W_car_}}, kGhostTau_m, space_);
  // The grid's own error: on a large triangle a border crosses some 400 cells of 0.015 cm^2, each
  // off by 0.3 of itself (one sigma of an even spread), so 0.1 cm^2; of 30 such triangles 0.5 cm^2,
  // and four times that.
  constexpr double kGrid_m2 = 2e-4;
  for (std::size_t k = 0; k < exact_m2.size(); ++k) {
    EXPECT_NEAR(scores.space[k].area_m2, exact_m2[k],
                kStandardErrors * scores.space[k].standard_error_m2 + kGrid_m2)
        << kGhostSpaceNames[k];
    EXPECT_GT(exact_m2[k], 0.05) << kGhostSpaceNames[k];
  }
  EXPECT_NEAR(scores.ghosts.area_m2, exact_m2[0] + exact_m2[1],
              kStandardErrors * scores.ghosts.standard_error_m2 + kGrid_m2);
  ASSERT_EQ(scores.samples.size(), scores.sample_space.size());
  double sampled_m2 = 0;
  for (const float area_m2 : scores.samples.area_m2) sampled_m2 += area_m2;
  EXPECT_NEAR(sampled_m2, scores.ghosts.area_m2 + scores.space[2].area_m2, 1e-4);
}

TEST_F(GhostScene, EmptyMesh) {
  const GhostScores scores = ScoreGhosts(TriangleMesh{}, {}, {}, kGhostTau_m, space_);
  EXPECT_EQ(scores.ghosts.area_m2, 0);
  EXPECT_FALSE(scores.share_of_mesh.value);
}

}  // namespace
}  // namespace tsdfpp
