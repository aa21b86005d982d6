// The references against answers worked out by hand: a flat wall before a camera in the origin that
// looks along +z. The voxel is 1/32 m, so that lengths in voxels are exact in binary.
#include <gtest/gtest.h>

#include <cmath>

#include "tests/mapper/compare_maps.h"
#include "tests/reference/dense_map.h"

namespace tsdfpp {
namespace {

using Vector3i = Eigen::Vector3i;
using reference::DenseMap;

constexpr double kBinaryVoxel_m = 1.0 / 32;
constexpr auto kVoxel = static_cast<float>(kBinaryVoxel_m);

MapConfig WallConfig() {
  MapConfig config;
  config.voxel_m = kBinaryVoxel_m;
  config.trunc_front_voxels = 3;
  config.trunc_back_voxels = 2;
  return config;
}

reference::Box WallBox() { return {{-24, -24, -8}, {23, 23, 31}}; }

// A wall at z = `voxels` voxels, all of one label and colour. The image is 33 pixels wide, with the
// axis through the middle pixel: the ray of pixel (16 + k, 16) at z passes x = k z / 16.
Frame Wall(double voxels, InstanceId label = 0, cv::Scalar colour = {100, 50, 25}) {
  Frame frame;
  frame.intrinsics = {33, 33, 16, 16, 16, 16};
  frame.depth = cv::Mat(33, 33, CV_32FC1, cv::Scalar(voxels * kBinaryVoxel_m));
  frame.colour = cv::Mat(33, 33, CV_8UC3, colour);
  frame.mask = cv::Mat(33, 33, CV_16UC1, cv::Scalar(label));
  return frame;
}

std::unique_ptr<DenseMap> Make(Method method, const MapConfig& config = WallConfig()) {
  return reference::MakeDenseMap(method, config, WallBox());
}

void Fuse(DenseMap& map, const Frame& frame) { map.Fuse(frame, frame.mask); }

TEST(ReferenceSelfTest, OnTheAxisTheDistanceIsDepthMinusHeight) {
  const auto map = Make(Method::kTsdfpp);
  Fuse(*map, Wall(16));
  for (int z = 8; z <= 18; ++z) {  // block 1, 8..15, and block 2 hold band points; 8..12 is clamped
    const auto value = map->ValueAt(0, {0, 0, z});
    ASSERT_TRUE(value.has_value()) << z;
    EXPECT_EQ(value->distance_m, std::min(16 - z, 3) * kVoxel) << z;
    EXPECT_EQ(value->weight, 1) << z;
    const Colour expected = z >= 13 ? Colour{100, 50, 25} : Colour{};  // clamped: no colour
    EXPECT_EQ(value->colour, expected) << z;
  }
  EXPECT_FALSE(map->ValueAt(0, {0, 0, 19}));  // behind the band
  EXPECT_FALSE(map->ValueAt(0, {0, 0, 7}));   // no block: free space far in front
  EXPECT_FALSE(map->ValueAt(1, {0, 0, 16}));  // no such object
}

TEST(ReferenceSelfTest, OffTheAxisTheDistanceIsAlongTheRay) {
  const auto map = Make(Method::kTsdf);
  Fuse(*map, Wall(16));
  // (8, 6, 14): depth 2 voxels in front, along a ray of length sqrt(64 + 36 + 196) over 14.
  const auto value = map->ValueAt(0, {8, 6, 14});
  ASSERT_TRUE(value.has_value());
  constexpr float kHalf_m = 0x1p-15F;  // half of the step between two numbers of 1/16 to 1/8
  EXPECT_NEAR(value->distance_m, 2 * kVoxel * std::sqrt(296.0F) / 14.0F, kHalf_m);
}

TEST(ReferenceSelfTest, ObservationsAverageUpToTheCap) {
  MapConfig config = WallConfig();
  config.weight_cap = 2;
  const auto map = Make(Method::kTsdfpp, config);
  Fuse(*map, Wall(16, 0, {100, 100, 100}));
  Fuse(*map, Wall(15, 0, {50, 50, 50}));
  // Voxel 15: 1 and 0; colour 100 and 50.
  EXPECT_EQ(map->ValueAt(0, {0, 0, 15})->distance_m, 0.5F * kVoxel);
  EXPECT_EQ(map->ValueAt(0, {0, 0, 15})->weight, 2);
  EXPECT_EQ(map->ValueAt(0, {0, 0, 15})->colour, (Colour{75, 75, 75}));
  Fuse(*map, Wall(17, 0, {75, 75, 75}));
  // (2 * 0.5 + 2) / 3 = 1, the weight stays.
  EXPECT_FLOAT_EQ(map->ValueAt(0, {0, 0, 15})->distance_m, kVoxel);
  EXPECT_EQ(map->ValueAt(0, {0, 0, 15})->weight, 2);
}

TEST(ReferenceSelfTest, LabelsVoteInOneField) {
  const auto map = Make(Method::kTsdf);
  const Vector3i v(0, 0, 15);
  Fuse(*map, Wall(16, 4));
  Fuse(*map, Wall(16, 4));
  EXPECT_EQ(map->ListAt(v), (std::vector<Listing>{{4, 2}}));
  Fuse(*map, Wall(16, 7));
  EXPECT_EQ(map->ListAt(v), (std::vector<Listing>{{4, 1}}));
  Fuse(*map, Wall(16, 7));
  EXPECT_EQ(map->ListAt(v), (std::vector<Listing>{{7, 1}}));
  EXPECT_EQ(map->ValueAt(7, v)->weight, 4);
  EXPECT_FALSE(map->ValueAt(4, v));
  EXPECT_TRUE(map->ListAt({0, 0, 10}).empty());  // clamped: observed, but no vote
}

TEST(ReferenceSelfTest, AMoveByOneVoxelShiftsAndErodes) {
  const auto map = Make(Method::kTsdfpp);
  map->SetObjectPose(4, Pose::Identity());
  Fuse(*map, Wall(16, 4));
  Pose moved = Pose::Identity();
  moved.translation().z() = kBinaryVoxel_m;
  map->SetObjectPose(4, moved);
  // Voxel z takes voxel z - 1 where the eight voxels z - 1, z (and 0, 1 sideways) are observed.
  // Beside the axis 18 is a little farther than the band's two voxels along its ray, so 8..17 are.
  for (int z = 9; z <= 17; ++z) {
    ASSERT_TRUE(map->ValueAt(4, {0, 0, z})) << z;
    EXPECT_EQ(map->ValueAt(4, {0, 0, z})->distance_m, std::min(17 - z, 3) * kVoxel) << z;
  }
  EXPECT_FALSE(map->ValueAt(4, {0, 0, 8}));
  EXPECT_FALSE(map->ValueAt(4, {0, 0, 18}));
  // Half a voxel back: means of neighbours, again one voxel fewer.
  moved.translation().z() = kBinaryVoxel_m / 2;
  map->SetObjectPose(4, moved);
  EXPECT_EQ(map->ValueAt(4, {0, 0, 16})->distance_m, 0.5F * kVoxel);
  EXPECT_FALSE(map->ValueAt(4, {0, 0, 17}));
}

TEST(ReferenceSelfTest, CoverIsTheCrossedCubesAndTheBandBehind) {
  const auto map = Make(Method::kTsdfpp);
  Fuse(*map, Wall(16.5));
  // D is 0.5 at 16 and -0.5 at 17: cube 16 is crossed, so voxels 16 and 17 are covered; 18 is at
  // -1.5; 19 is behind the band (-2.5).
  for (int z = 8; z <= 20; ++z) {
    const std::vector<Listing> expected =
        z >= 16 && z <= 18 ? std::vector<Listing>{{0, 1}} : std::vector<Listing>{};
    EXPECT_EQ(map->ListAt({0, 0, z}), expected) << z;
  }
}

TEST(ReferenceSelfTest, TheMovedObjectBecomesActive) {
  const auto map = Make(Method::kTsdfpp);
  Fuse(*map, Wall(16.5, 0));
  map->SetObjectPose(4, Pose::Identity());
  Fuse(*map, Wall(10.5, 4));
  Pose moved = Pose::Identity();
  moved.translation().z() = 6 * kBinaryVoxel_m;
  map->SetObjectPose(4, moved);
  EXPECT_EQ(map->ListAt({0, 0, 16}), (std::vector<Listing>{{4, 1}, {0, 1}}));
  EXPECT_TRUE(map->ListAt({0, 0, 10}).empty());
  map->Remove(4);
  EXPECT_EQ(map->ListAt({0, 0, 16}), (std::vector<Listing>{{0, 1}}));
}

TEST(ReferenceSelfTest, TheDisplacedIsDemoted) {
  const auto map = Make(Method::kTsdfpp);
  Fuse(*map, Wall(16.5, 4));
  const Vector3i v(0, 0, 16);
  EXPECT_EQ(map->ListAt(v), (std::vector<Listing>{{4, 1}}));
  Fuse(*map, Wall(16.5, 7));
  // 7 votes against the one vote of 4, which falls to 0. Voxel 17, where 4 claims -0.5 voxels and
  // the surface is as far away, is not solid enough to be contradicted.
  EXPECT_EQ(map->ListAt(v), (std::vector<Listing>{{7, 1}, {4, 0}}));
  EXPECT_TRUE(map->ValueAt(4, {0, 0, 17}));
}

TEST(ReferenceSelfTest, ContradictionClearsWhatIsSeenThrough) {
  for (const bool contradiction : {true, false}) {
    MapConfig config = WallConfig();
    config.contradiction = contradiction;
    const auto map = Make(Method::kTsdfppAnchored, config);
    Fuse(*map, Wall(12.5, 4));  // -1.5 voxels at 14
    Fuse(*map, Wall(17, 7));    // sees 3 voxels past 14
    const auto value = map->ValueAt(4, {0, 0, 14});
    ASSERT_TRUE(value.has_value());
    EXPECT_EQ(value->distance_m, contradiction ? 3 * kVoxel : -1.5F * kVoxel);
    EXPECT_EQ(value->weight, 1);
    EXPECT_EQ(value->colour, contradiction ? Colour{} : (Colour{100, 50, 25}));
  }
  const auto map = Make(Method::kTsdfppAnchored);
  Fuse(*map, Wall(12.5, 4));
  Fuse(*map, Wall(14.5, 7));  // half a voxel past 14: cleared, and nothing known instead
  EXPECT_FALSE(map->ValueAt(4, {0, 0, 14}));
}

TEST(ReferenceSelfTest, AnchoredOrdersByDistanceAndMovesOnlyTheIndex) {
  const auto map = Make(Method::kTsdfppAnchored);
  map->SetObjectPose(4, Pose::Identity());
  Fuse(*map, Wall(16.5, 0));
  Fuse(*map, Wall(10.5, 4));
  Pose moved = Pose::Identity();
  moved.translation().z() = 5.25 * kBinaryVoxel_m;  // its surface is now at 15.75
  map->SetObjectPose(4, moved);
  EXPECT_EQ(map->ListAt({0, 0, 16}), (std::vector<Listing>{{4, 0}, {0, 0}}));
  EXPECT_TRUE(map->ListAt({0, 0, 15}).empty());  // 9.75 in its lattice, where no cube is crossed
  EXPECT_EQ(map->ValueAt(4, {0, 0, 10})->distance_m, 0.5F * kVoxel);  // its lattice has not moved
  moved.translation().z() = 7 * kBinaryVoxel_m;                       // 17.5: behind the other
  map->SetObjectPose(4, moved);
  EXPECT_EQ(map->ListAt({0, 0, 17}), (std::vector<Listing>{{0, 0}, {4, 0}}));
}

TEST(ReferenceSelfTest, LiteralWritesToTheActiveObject) {
  const auto map = Make(Method::kTsdfppLiteral);
  const Vector3i v(0, 0, 15);
  Fuse(*map, Wall(16, 4));
  Fuse(*map, Wall(16, 4));
  Fuse(*map, Wall(15, 7));  // 4 stays active with one vote left, and takes what 7 showed
  EXPECT_EQ(map->ListAt(v), (std::vector<Listing>{{4, 1}}));
  EXPECT_EQ(map->ValueAt(4, v)->weight, 3);
  EXPECT_FALSE(map->ValueAt(7, v));
  Fuse(*map, Wall(15, 7));
  EXPECT_EQ(map->ListAt(v), (std::vector<Listing>{{7, 1}}));  // 4 is gone
  EXPECT_EQ(map->ValueAt(7, v)->weight, 1);
}

TEST(ReferenceSelfTest, CrossedCubesOfAWall) {
  const auto map = Make(Method::kTsdfpp);
  Fuse(*map, Wall(16.5));
  const auto cubes = map->CrossedCubesOf(0);
  ASSERT_FALSE(cubes.empty());
  // Away from the rim, where rays are slanted, the wall crosses the cubes of layer 16 alone.
  for (const Vector3i& cube : cubes) EXPECT_EQ(cube.z(), 16) << Text(cube);
  for (int x = -4; x < 4; ++x) {
    EXPECT_NE(std::find(cubes.begin(), cubes.end(), Vector3i(x, 0, 16)), cubes.end()) << x;
  }
}

}  // namespace
}  // namespace tsdfpp
