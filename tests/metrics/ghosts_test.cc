#include "metrics/ghosts.h"

#include <gtest/gtest.h>

#include "metrics/accuracy.h"
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

// A table (slab from z = 2 to 2.1) seen from the origin.
class GhostScene : public ::testing::Test {
 protected:
  GhostScene()
      : table_(testing::Model(kGhostTable, testing::Box({-1, -1, 2}, {1, 1, 2.1F}))),
        car_(testing::Model(2, testing::Box({-0.1F, -0.1F, -0.1F}, {0.1F, 0.1F, 0.1F}))) {
    space_.Observe(WallAt(2));
  }
  static TriangleMesh Plate(float z) {
    return testing::Sheet({-0.15F, -0.15F, z}, {0, 0.3F, 0}, {0.3F, 0, 0}, 30);
  }
  // cm^2 of ghosts in a mesh of the table's top and these plates.
  GhostScores Score(const std::vector<TriangleMesh>& plates, bool with_car,
                    const FreeSpace* observed) const {
    TriangleMesh mesh = testing::Sheet({-1, -1, 2.002F}, {0, 2, 0}, {2, 0, 0}, 100);
    for (const auto& plate : plates) testing::Append(mesh, plate);
    Pose T_W_car = Pose::Identity();
    T_W_car.translation().z() = 1.5;
    std::vector<PlacedTruth> truths = {{&table_, Pose::Identity()}};
    if (with_car) truths.push_back({&car_, T_W_car});
    return ScoreGhosts(SampleReconstruction(mesh, {4, 200'000, 1}), truths, kGhostTau_m, observed);
  }

  TruthSurface table_;
  TruthSurface car_;
  FreeSpace space_;
};

constexpr double kPlate_m2 = 0.09;
// 4 samples a cm^2 over 3,600 samples, uncertain by a few at either end.
constexpr double kSampled_m2 = 2e-4;

TEST_F(GhostScene, PlantedPlateIsItsArea) {
  const GhostScores scores = Score({Plate(1.5F)}, false, &space_);
  EXPECT_NEAR(scores.area_m2, kPlate_m2, kSampled_m2);
  EXPECT_NEAR(*scores.share_of_mesh.value, kPlate_m2 / (4 + kPlate_m2), 1e-4);
  EXPECT_EQ(Score({}, false, &space_).area_m2, 0);
}

TEST_F(GhostScene, OnlyInObservedFreeSpaceUnlessRevealed) {
  // 5 cm deep in the slab, and 40 cm below the table, where nobody looked.
  EXPECT_EQ(Score({Plate(2.05F)}, false, &space_).area_m2, 0);
  EXPECT_EQ(Score({Plate(2.5F)}, false, &space_).area_m2, 0);
  EXPECT_EQ(Score({Plate(2.05F)}, false, nullptr).area_m2, 0) << "inside a true solid";
  EXPECT_NEAR(Score({Plate(2.5F)}, false, nullptr).area_m2, kPlate_m2, kSampled_m2);
}

// With the car at z = 1.5 its inside is no free space; after its removal the same surface is a
// ghost.
TEST_F(GhostScene, InsideACarUntilItIsRemoved) {
  const double outside_m2 = 0.3 * 0.3 - 0.22 * 0.22;  // farther than tau from the car's sides
  const double rounded_m2 = (4 - 3.14159265) * kGhostTau_m * kGhostTau_m;
  EXPECT_NEAR(Score({Plate(1.5F)}, true, &space_).area_m2, outside_m2 + rounded_m2, 2e-4);
  EXPECT_NEAR(Score({Plate(1.5F)}, false, nullptr).area_m2, kPlate_m2, kSampled_m2);
}

TEST_F(GhostScene, EmptyMesh) {
  const GhostScores scores = ScoreGhosts(SampleSet{}, {}, kGhostTau_m, nullptr);
  EXPECT_EQ(scores.area_m2, 0);
  EXPECT_FALSE(scores.share_of_mesh.value);
}

}  // namespace
}  // namespace tsdfpp
