// Distances from the surface (docs/map.md): what maps keep of an object seen aslant.
#include <gtest/gtest.h>

#include <cmath>

#include "mapper/map_representation.h"
#include "mapper/voxel_inspection.h"
#include "tests/mapper/toy_scene.h"

namespace tsdfpp {
namespace {

constexpr InstanceId kWall = 2;
constexpr double kWallVoxel_m = 0.01;
const Intrinsics kCamera{160, 120, 150.0, 150.0, 79.5, 59.5};
// Of a mean over voxels whose rays meet the wall a few degrees more or less aslant than the middle
// one: a share of what is expected.
constexpr double kAround = 0.12;

// A wall, the plane y = 0, before which the camera stands so that its middle ray meets the wall so
// many degrees off its normal.
Frame WallSeenAt(double degrees, InstanceId id) {
  reference::Scene scene;
  scene.shapes.push_back(reference::Cuboid(id, {90, 120, 150}, Pose::Identity(), {0.4, 0.05, 0.4}));
  const Eigen::Vector3d target(0, 0.05, 0);
  const double angle = degrees * EIGEN_PI / 180;
  const Eigen::Vector3d eye =
      target + 0.5 * Eigen::Vector3d(std::sin(angle), std::cos(angle), 0.02);
  if (id != kBackground) scene.T_WO[id] = Pose::Identity();
  return reference::Render(scene, reference::LookAt(eye, target), 1, kCamera);
}

std::unique_ptr<MapRepresentation> MapOf(Method method, Distances distances, const Frame& frame) {
  MapConfig config;
  config.voxel_m = kWallVoxel_m;
  config.distances = distances;
  auto map = MakeMap(method, config);
  for (const auto& [id, T_WO] : frame.T_WO) map->SetObjectPose(id, T_WO);
  map->Fuse(frame, frame.mask);
  return map;
}

// Of the voxels about the picture's middle and the surface, the mean ratio of what is kept to the
// distance from the wall, and how many there are.
struct Ratio {
  double mean = 0;
  int voxels = 0;
};
Ratio RatioOf(const MapRepresentation& map, InstanceId id) {
  Ratio ratio;
  for (const Eigen::Vector3i& voxel : VoxelsOf(map).ObservedVoxels(id)) {
    const Eigen::Vector3d p_W = kWallVoxel_m * voxel.cast<double>();
    const double away = p_W.y() - 0.05;
    if (std::abs(p_W.x()) > 0.04 || std::abs(p_W.z()) > 0.04) continue;
    if (away < 0.5 * kWallVoxel_m || away > 2.5 * kWallVoxel_m) continue;
    const double kept = VoxelsOf(map).ValueAt(id, voxel)->distance_m;
    ratio.mean += kept / away;
    ++ratio.voxels;
  }
  ratio.mean /= std::max(1, ratio.voxels);
  return ratio;
}

class SurfaceDistances : public ::testing::TestWithParam<Method> {};

TEST_P(SurfaceDistances, AreThoseFromTheWallBeyond45Degrees) {
  for (const double degrees : {20.0, 60.0, 75.0}) {
    const Frame frame = WallSeenAt(degrees, kWall);
    const double cosine = std::cos(degrees * EIGEN_PI / 180);
    for (const Distances distances : {Distances::kRay, Distances::kSurface}) {
      const auto map = MapOf(GetParam(), distances, frame);
      const Ratio ratio = RatioOf(*map, kWall);
      ASSERT_GT(ratio.voxels, 100);
      const double expected =
          distances == Distances::kRay ? 1 / cosine : std::min(1 / cosine, std::sqrt(2.0));
      EXPECT_NEAR(ratio.mean, expected, kAround * expected)
          << degrees << " degrees, " << DistancesName(distances);
      EXPECT_EQ(VoxelsOf(*map).FindFault(), std::nullopt);
    }
  }
}

TEST_P(SurfaceDistances, LeaveTheBackgroundAlone) {
  const Frame frame = WallSeenAt(70, kBackground);
  const auto by_ray = MapOf(GetParam(), Distances::kRay, frame);
  const auto by_surface = MapOf(GetParam(), Distances::kSurface, frame);
  const auto voxels = VoxelsOf(*by_ray).ObservedVoxels(kBackground);
  ASSERT_GT(voxels.size(), 1000U);
  ASSERT_EQ(voxels, VoxelsOf(*by_surface).ObservedVoxels(kBackground));
  for (const Eigen::Vector3i& voxel : voxels) {
    ASSERT_EQ(VoxelsOf(*by_ray).ValueAt(kBackground, voxel)->distance_m,
              VoxelsOf(*by_surface).ValueAt(kBackground, voxel)->distance_m);
  }
}

INSTANTIATE_TEST_SUITE_P(Methods, SurfaceDistances,
                         ::testing::Values(Method::kTsdf, Method::kTsdfGuarded, Method::kTsdfpp,
                                           Method::kTsdfppLiteral, Method::kTsdfppAnchored,
                                           Method::kVolumes),
                         [](const auto& of) {
                           std::string name(MethodName(of.param));
                           std::erase_if(name, [](char c) { return std::isalnum(c) == 0; });
                           return name + std::to_string(of.index);
                         });

}  // namespace
}  // namespace tsdfpp
