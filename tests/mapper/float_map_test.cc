// The references in floating point (tests/reference/float_map.h) against arithmetic by hand, and
// against the production maps: bit for bit where they store as those do, else within what half
// precision rounds.
#include "tests/reference/float_map.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <tuple>

#include "mapper/voxel_inspection.h"
#include "tests/mapper/compare_maps.h"
#include "tests/mapper/toy_scene.h"

namespace tsdfpp {
namespace {

using reference::FieldMoves;
using reference::FloatConfig;
using reference::FloatMap;
using reference::FloatRule;
using reference::FloatVoxel;
using reference::MakePose;
using reference::Scene;
using reference::Seen;

// What production's `tsdf` moves.
constexpr FieldMoves kProductionMoves = FieldMoves::kAll;

constexpr double kCentimetre_m = 0.01;
constexpr float kVoxel_m = 0.01F;

// A change of the last bits: these are single-precision results of a few operations.
constexpr float kFloatTolerance = 1e-6F;

FloatConfig Released() {
  FloatConfig config;
  config.voxel_m = kCentimetre_m;
  config.front_voxels = 3;
  config.back_voxels = 3;
  config.weighting = {true, true, false, 10000};
  return config;
}

Seen At(float s, float z) {
  Seen seen;
  seen.s = s;
  seen.surface_z = z;
  seen.voxel_z = z - s;
  seen.label = kBackground;
  return seen;
}

Intrinsics SomeCamera() { return {64, 48, 200, 100, 32, 24}; }

TEST(FloatWeightTest, FallsWithTheSquareOfTheDepth) {
  const FloatRule rule(Released());
  EXPECT_FLOAT_EQ(rule.WeightOf(At(0, 0.5F), SomeCamera()), 4);
  EXPECT_FLOAT_EQ(rule.WeightOf(At(0.02F, 2), SomeCamera()), 0.25F);
}

// Behind the surface by more than a voxel: (B + s) / (B - h) of the weight, B = 3 h.
TEST(FloatWeightTest, DropsOffBehindTheSurface) {
  const FloatRule rule(Released());
  EXPECT_FLOAT_EQ(rule.WeightOf(At(-0.9F * kVoxel_m, 1), SomeCamera()), 1);
  EXPECT_NEAR(rule.WeightOf(At(-1.5F * kVoxel_m, 1), SomeCamera()), 0.75F, 1e-3F);
  EXPECT_NEAR(rule.WeightOf(At(-2 * kVoxel_m, 1), SomeCamera()), 0.5F, 1e-3F);
  EXPECT_EQ(rule.WeightOf(At(-3.5F * kVoxel_m, 1), SomeCamera()), 0);
  // Both factors: a quarter for two metres, half for two voxels.
  EXPECT_NEAR(rule.WeightOf(At(-2 * kVoxel_m, 2), SomeCamera()), 0.125F, 1e-3F);
}

TEST(FloatWeightTest, SumsTheRaysOfAVoxel) {
  FloatConfig config = Released();
  config.weighting.inverse_square = false;
  config.weighting.rays = true;
  // At 0.5 m a voxel of 1 cm covers 200 * 0.01 / 0.5 = 4 by 100 * 0.01 / 0.5 = 2 pixels.
  Seen seen = At(0, 0.5F);
  EXPECT_NEAR(FloatRule(config).WeightOf(seen, SomeCamera()), 8, 1e-4F);
  config.weighting.inverse_square = true;
  EXPECT_NEAR(FloatRule(config).WeightOf(seen, SomeCamera()), 32, 1e-4F);
}

TEST(FloatWeightTest, MeansAreWeighted) {
  const FloatRule rule(Released());
  FloatVoxel voxel;
  const auto fuse = [&](float s, float weight) { rule.Fuse(At(s, 1), weight, voxel); };
  fuse(0.01F, 4);
  EXPECT_EQ(voxel.distance, 0.01F);
  EXPECT_EQ(voxel.weight, 4);
  fuse(-0.02F, 0.5F);  // (4 * 0.01 - 0.5 * 0.02) / 4.5
  EXPECT_NEAR(voxel.distance, 0.03F / 4.5F, kFloatTolerance);
  EXPECT_FLOAT_EQ(voxel.weight, 4.5F);
  fuse(1, 1.5F);                                   // clamped to 3 cm first: (0.03 + 1.5 * 0.03) / 6
  EXPECT_NEAR(voxel.distance, 0.075F / 6, 1e-5F);  // F is the half next to 3 cm
  fuse(-0.031F, 100);                              // behind the band: nothing
  EXPECT_FLOAT_EQ(voxel.weight, 6);
}

TEST(FloatWeightTest, TheMeanCanBeClampedInstead) {
  FloatConfig config = Released();
  config.clamp_mean = true;
  const FloatRule rule(config);
  FloatVoxel voxel{-0.02F, 9};
  rule.Fuse(At(0.13F, 1), 1, voxel);  // (-0.18 + 0.13) / 10
  EXPECT_NEAR(voxel.distance, -0.005F, kFloatTolerance);
  rule.Fuse(At(10, 1), 1, voxel);
  EXPECT_EQ(voxel.distance, rule.front());
}

TEST(FloatWeightTest, StopsAtTheCap) {
  FloatConfig config = Released();
  config.weighting.cap = 10;
  const FloatRule rule(config);
  FloatVoxel voxel{0, 9.5F};
  rule.Fuse(At(0.01F, 1), 4, voxel);  // the mean is taken with all of it
  EXPECT_NEAR(voxel.distance, 0.04F / 13.5F, kFloatTolerance);
  EXPECT_EQ(voxel.weight, 10);
}

// What a byte makes of it: fractions are lost, and so is what is above 255.
TEST(FloatWeightTest, BytesLoseFractions) {
  FloatConfig config = Released();
  config.byte_weights = true;
  const FloatRule rule(config);
  FloatVoxel voxel;
  rule.Fuse(At(0.01F, 1), 0.4F, voxel);
  EXPECT_FALSE(voxel.observed());
  EXPECT_EQ(voxel.distance, 0);
  for (int i = 0; i < 20; ++i) rule.Fuse(At(0.01F, 1), 1.4F, voxel);
  EXPECT_EQ(voxel.weight, 20);
  rule.Fuse(At(0.01F, 1), 1000, voxel);
  EXPECT_EQ(voxel.weight, 255);
}

// Sees one plane, all over its image, at a depth in voxels.
Frame Wall(double depth_voxels, InstanceId label) {
  Frame frame;
  frame.intrinsics = {33, 33, 100, 100, 16, 16};
  frame.depth = cv::Mat(33, 33, CV_32FC1, cv::Scalar(depth_voxels * kCentimetre_m));
  frame.mask = cv::Mat(33, 33, CV_16UC1, cv::Scalar(label));
  frame.colour = cv::Mat(33, 33, CV_8UC3, cv::Scalar(0, 0, 0));
  return frame;
}

Pose Along(double z_voxels) {
  Pose pose = Pose::Identity();
  pose.translation().z() = z_voxels * kCentimetre_m;
  return pose;
}

// The wall moves away by two voxels, the free space before it too, and leaves nothing behind.
TEST(FloatTsdfTest, AllThatIsLabelledMoves) {
  FloatConfig config;
  config.back_voxels = 3;
  config.front_voxels = 5;
  for (const FieldMoves moves : {FieldMoves::kAll, FieldMoves::kNear, FieldMoves::kNone}) {
    const auto map = reference::MakeFloatTsdf(config, moves);
    map->SetObjectPose(4, Pose::Identity());
    const Frame frame = Wall(40.5, 4);
    map->Fuse(frame, frame.mask);
    const auto before = [&](int z) { return map->ValueAt(4, {0, 0, z}); };
    ASSERT_TRUE(before(37));
    EXPECT_NEAR(before(37)->distance, 3.5F * kVoxel_m, 1e-4F);
    map->SetObjectPose(4, Along(2));
    if (moves == FieldMoves::kNone) {
      EXPECT_NEAR(map->ValueAt(4, {0, 0, 37})->distance, 3.5F * kVoxel_m, 1e-4F);
      map->Remove(4);
      EXPECT_TRUE(map->ObservedVoxels(4).empty());
      continue;
    }
    EXPECT_NEAR(map->ValueAt(4, {0, 0, 42})->distance, 0.5F * kVoxel_m, 1e-4F);
    // Free space: where it all moves it is now two voxels on, and what it left is unobserved; the
    // other rule leaves it where it was.
    if (moves == FieldMoves::kAll) {
      EXPECT_NEAR(map->ValueAt(4, {0, 0, 39})->distance, 3.5F * kVoxel_m, 1e-4F);
      EXPECT_FALSE(map->ValueAt(4, {0, 0, 36}));
    } else {
      EXPECT_NEAR(map->ValueAt(4, {0, 0, 39})->distance, 1.5F * kVoxel_m, 1e-2F * kVoxel_m);
      EXPECT_NEAR(map->ValueAt(4, {0, 0, 36})->distance, 4.5F * kVoxel_m, 1e-4F);
    }
    map->Remove(4);
    EXPECT_EQ(map->ObservedVoxels(4).empty(), moves == FieldMoves::kAll);
  }
}

// A float map and production's of the same method and settings, through the same events.
struct Pair {
  std::unique_ptr<MapRepresentation> production;
  std::unique_ptr<FloatMap> floats;

  void SetPosesAndFuse(const Frame& frame) {
    for (const auto& [id, T_WO] : frame.T_WO) {
      production->SetObjectPose(id, T_WO);
      floats->SetObjectPose(id, T_WO);
    }
    production->Fuse(frame, frame.mask);
    floats->Fuse(frame, frame.mask);
  }
  void Remove(InstanceId id) {
    production->Remove(id);
    floats->Remove(id);
  }
};

Pair MakePair(Method method, double back_voxels, bool half_distances, bool byte_weights) {
  MapConfig settings = ToyConfig(back_voxels);
  settings.rims = false;  // the float maps have none
  FloatConfig config;
  config.voxel_m = settings.voxel_m;
  config.front_voxels = settings.trunc_front_voxels;
  config.back_voxels = settings.trunc_back_voxels;
  config.weighting.cap = static_cast<float>(settings.weight_cap);
  config.half_distances = half_distances;
  config.byte_weights = byte_weights;
  return {MakeMap(method, settings), method == Method::kTsdf
                                         ? reference::MakeFloatTsdf(config, kProductionMoves)
                                         : reference::MakeFloatTsdfpp(config)};
}

constexpr int kDriveFrames = 6;

// Fusion, moves, contradiction and votes: a brick drives and turns, a ball rolls towards it.
void Drive(Pair& maps) {
  Scene scene = TableWithToys();
  maps.SetPosesAndFuse(RenderToys(scene, 0.2));
  for (int i = 1; i < kDriveFrames; ++i) {
    scene.T_WO[kBrick] = MakePose(0.3 + 0.25 * i, Eigen::Vector3d::UnitZ(),
                                  {-0.14 + 0.04 * i, 0.03 - 0.01 * i, kTableTop_m + 0.045});
    scene.T_WO[kBall] =
        MakePose(0.3 * i, {0, 1, 0.2}, {0.12 - 0.015 * i, -0.08, kTableTop_m + 0.055});
    maps.SetPosesAndFuse(RenderToys(scene, 0.2 + 0.3 * i, i));
  }
}

// Triangles by the places of their corners, whatever the order of either.
std::vector<std::vector<float>> SortedTriangles(const TriangleMesh& mesh) {
  std::vector<std::vector<float>> triangles;
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    std::array<std::array<float, 3>, 3> corners;
    for (std::size_t k = 0; k < 3; ++k) {
      const Eigen::Vector3f& p = mesh.vertices[mesh.triangles[i][k]];
      corners[k] = {p.x(), p.y(), p.z()};
    }
    std::rotate(corners.begin(), std::min_element(corners.begin(), corners.end()), corners.end());
    std::vector<float> flat{static_cast<float>(mesh.face_ids[i])};
    for (const auto& corner : corners) flat.insert(flat.end(), corner.begin(), corner.end());
    triangles.push_back(std::move(flat));
  }
  std::sort(triangles.begin(), triangles.end());
  return triangles;
}

class FloatMapTest : public ::testing::TestWithParam<std::tuple<Method, double>> {
 protected:
  Pair Begin(bool half_distances, bool byte_weights) const {
    return MakePair(std::get<0>(GetParam()), std::get<1>(GetParam()), half_distances, byte_weights);
  }
};

INSTANTIATE_TEST_SUITE_P(Methods, FloatMapTest,
                         ::testing::Combine(::testing::Values(Method::kTsdf, Method::kTsdfpp),
                                            ::testing::Values(4.0, 2.0)),
                         [](const auto& parameters) {
                           return std::string(std::get<0>(parameters.param) == Method::kTsdf
                                                  ? "tsdf"
                                                  : "tsdfpp") +
                                  "_back_" +
                                  std::to_string(static_cast<int>(std::get<1>(parameters.param)));
                         });

void ExpectSame(const Pair& maps) {
  for (const InstanceId id : ToyIds()) {
    const auto observed = VoxelsOf(*maps.production).ObservedVoxels(id);
    ASSERT_TRUE(SameVoxels(maps.floats->ObservedVoxels(id), observed)) << "object " << id;
    for (const Eigen::Vector3i& v : observed) {
      const auto value = maps.floats->ValueAt(id, v);
      const auto expected = VoxelsOf(*maps.production).ValueAt(id, v);
      ASSERT_TRUE(value) << Text(v);
      ASSERT_EQ(value->distance, expected->distance_m) << Text(v) << " of object " << id;
      ASSERT_EQ(value->weight, expected->weight) << Text(v) << " of object " << id;
    }
  }
  ASSERT_TRUE(SameLists(*maps.production, *maps.floats));
  EXPECT_EQ(SortedTriangles(maps.floats->SceneMesh()),
            SortedTriangles(maps.production->SceneMesh()));
}

TEST_P(FloatMapTest, StoringAsProductionDoesItIsProduction) {
  Pair maps = Begin(true, true);
  Drive(maps);
  ASSERT_FALSE(VoxelsOf(*maps.production).ObservedVoxels(kBrick).empty());
  ExpectSame(maps);
  maps.Remove(kBrick);
  ExpectSame(maps);
}

// Distances as floats, weights as production's. Half precision keeps a distance below F = 8 cm to
// half of its last place there; fusion and moves are means, which make no error larger, so each of
// the events adds that at most.
TEST_P(FloatMapTest, FloatsAreWithinTheRoundingOfProduction) {
  constexpr float kHalfPlace_m = 1.0F / (1 << 15);
  constexpr float kRoundingTolerance_m = (2 * kDriveFrames - 1) * kHalfPlace_m;
  Pair maps = Begin(false, true);
  Drive(maps);
  for (const InstanceId id : ToyIds()) {
    const auto observed = VoxelsOf(*maps.production).ObservedVoxels(id);
    std::size_t different = 0;
    for (const Eigen::Vector3i& v : observed) {
      const auto value = maps.floats->ValueAt(id, v);
      const float expected = VoxelsOf(*maps.production).ValueAt(id, v)->distance_m;
      // A threshold between the two values would part them; here none does.
      ASSERT_TRUE(value) << Text(v) << " of object " << id;
      ASSERT_NEAR(value->distance, expected, kRoundingTolerance_m) << Text(v) << " of " << id;
      if (value->distance != expected) ++different;
    }
    EXPECT_GT(different, observed.size() / 4) << "stored as production does it: object " << id;
  }
}

}  // namespace
}  // namespace tsdfpp
