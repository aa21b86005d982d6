// Values and vertices against analytic surfaces.
#include <gtest/gtest.h>

#include <cmath>

#include "mapper/voxel_inspection.h"
#include "tests/mapper/compare_maps.h"
#include "tests/mapper/mesh_checks.h"
#include "tests/mapper/toy_scene.h"

namespace tsdfpp {
namespace {

using reference::Scene;

// A voxel takes the depth of the nearest pixel, up to half a diagonal, 0.7 pixels, off its own ray.
// At 65 cm and f = 80 that is 5.7 mm sideways; where the surface is seen at 55 degrees from its
// normal its depth changes by 1.43 times that: 8.2 mm, 0.41 voxels, and a little more at the far
// end of the table.
constexpr double kPixelError_voxels = 0.5;
// Several views have such errors of both signs.
constexpr double kMeanError_voxels = 0.12;

Scene PlaneScene() {
  Scene scene;
  scene.shapes.push_back(reference::Plane(kBackground, {120, 120, 120}, kTableTop_m));
  return scene;
}

// The distance along the ray from a point to the plane.
double AlongRay(const Eigen::Vector3d& eye, const Eigen::Vector3d& p) {
  const Eigen::Vector3d ray = p - eye;
  return (kTableTop_m - p.z()) / ray.z() * ray.norm();
}

TEST(AccuracyTest, OneFrameOfAPlaneGivesTheDistanceAlongTheRay) {
  for (const Method method : AllMethods()) {
    const auto map = MakeMap(method, ToyConfig());
    // Steep, so that all of the image sees the plane within 55 degrees of its normal.
    const Pose T_WC = reference::LookAt({0.12, 0.1, 0.5}, {0, 0, 0});
    const Frame frame = reference::Render(PlaneScene(), T_WC);
    map->Fuse(frame, frame.mask);
    const MapConfig config = ToyConfig();
    double sum = 0;
    int count = 0;
    for (const auto& v : VoxelsOf(*map).ObservedVoxels(kBackground)) {
      const double s = AlongRay(T_WC.translation(), kToyVoxel_m * v.cast<double>());
      const double stored = VoxelsOf(*map).ValueAt(kBackground, v)->distance_m;
      ASSERT_LE(stored, config.front());
      ASSERT_GE(stored, -config.back());
      const double error = (stored - std::min<double>(s, config.front())) / kToyVoxel_m;
      ASSERT_LT(std::abs(error), kPixelError_voxels) << MethodName(method) << " " << Text(v);
      sum += std::abs(error);
      ++count;
    }
    EXPECT_GT(count, 3000) << MethodName(method);
    EXPECT_LT(sum / count, kMeanError_voxels) << MethodName(method);
  }
}

TEST(AccuracyTest, MeshOfAPlaneIsThePlane) {
  for (const Method method : AllMethods()) {
    const auto map = MakeMap(method, ToyConfig());
    for (int i = 0; i < 5; ++i) {
      const Pose T_WC = reference::LookAt({0.15 * std::cos(1.3 * i), 0.15 * std::sin(1.3 * i), 0.5},
                                          {0.01 * i, 0, 0});
      const Frame frame = reference::Render(PlaneScene(), T_WC);
      map->Fuse(frame, frame.mask);
    }
    const TriangleMesh mesh = map->SceneMesh();
    ASSERT_GT(mesh.vertices.size(), 500U);
    double sum = 0;
    for (const auto& p : mesh.vertices) {
      const double error = std::abs(p.z() - kTableTop_m) / kToyVoxel_m;
      ASSERT_LT(error, kPixelError_voxels) << MethodName(method);
      sum += error;
    }
    EXPECT_LT(sum / static_cast<double>(mesh.vertices.size()), kMeanError_voxels);
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
      ASSERT_GT(NormalOf(mesh, t).z(), 0) << "a triangle of the plane faces down";
    }
  }
}

TEST(AccuracyTest, MeshOfABallIsTheBall) {
  constexpr double kRadius_m = 0.15;
  const Eigen::Vector3d centre(0.01, 0.02, 0.2);
  Scene scene;
  scene.shapes.push_back(reference::Sphere(kBall, {30, 30, 200}, centre, kRadius_m));
  // At the rim of a ball the ray grazes it, and a pixel's error along the ray has no bound but the
  // band; across the surface it stays below a voxel.
  constexpr double kRimError_voxels = 1.0;
  constexpr double kMeanBallError_voxels = 0.2;
  for (const Method method : AllMethods()) {
    const auto map = MakeMap(method, ToyConfig());
    for (int i = 0; i < 8; ++i) {
      const double angle = 0.785 * i + 0.1;
      const Pose T_WC = reference::LookAt(
          centre + Eigen::Vector3d(0.5 * std::cos(angle), 0.5 * std::sin(angle), 0.15), centre);
      const Frame frame = reference::Render(scene, T_WC);
      map->Fuse(frame, frame.mask);
    }
    const TriangleMesh mesh = map->ObjectMesh(kBall);
    ASSERT_GT(mesh.vertices.size(), 300U);
    double sum = 0;
    std::size_t rim = 0;
    for (const auto& p : mesh.vertices) {
      const double error = std::abs((p.cast<double>() - centre).norm() - kRadius_m) / kToyVoxel_m;
      if (error > kRimError_voxels) ++rim;
      sum += error;
    }
    const auto count = static_cast<double>(mesh.vertices.size());
    EXPECT_EQ(rim, 0U) << MethodName(method) << " of " << count;
    EXPECT_LT(sum / count, kMeanBallError_voxels) << MethodName(method);
  }
}

}  // namespace
}  // namespace tsdfpp
