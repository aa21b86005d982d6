// The small scenes that the mapper's tests share: a table of 60 x 52 cm with three toys, in voxels
// of 2 cm.
#pragma once

#include <vector>

#include "core/random.h"
#include "mapper/map_config.h"
#include "tests/reference/analytic_scene.h"
#include "tests/reference/dense_grid.h"

namespace tsdfpp {

inline constexpr InstanceId kBrick = 1;
inline constexpr InstanceId kBall = 2;
inline constexpr InstanceId kTray = 3;
inline constexpr double kToyVoxel_m = 0.02;
// Not a multiple of half a voxel, so that no stored distance is 0 by accident.
inline constexpr double kTableTop_m = 0.007;

inline MapConfig ToyConfig(double back_voxels = 4) {
  MapConfig config;
  config.voxel_m = kToyVoxel_m;
  config.trunc_front_voxels = 4;
  config.trunc_back_voxels = back_voxels;
  return config;
}

// Holds the table and all that the toys do on it, bands included.
inline reference::Box ToyBox() { return {{-32, -32, -16}, {31, 31, 23}}; }

inline std::vector<InstanceId> ToyIds() { return {kBackground, kBrick, kBall, kTray}; }

inline reference::Scene TableOnly() {
  reference::Scene scene;
  scene.shapes.push_back(reference::Cuboid(
      kBackground, {150, 110, 70},
      reference::MakePose(0, Eigen::Vector3d::UnitZ(), {0, 0, kTableTop_m - 0.05}),
      {0.30, 0.26, 0.05}));
  return scene;
}

inline void AddBrick(reference::Scene& scene, double yaw_rad, const Eigen::Vector3d& place) {
  scene.shapes.push_back(
      reference::Cuboid(kBrick, {200, 30, 30}, Pose::Identity(), {0.075, 0.05, 0.045}));
  scene.T_WO[kBrick] = reference::MakePose(yaw_rad, Eigen::Vector3d::UnitZ(), place);
}
// With a knob, which turned by half a turn is another one.
inline void AddKnobbedBrick(reference::Scene& scene, double yaw_rad, const Eigen::Vector3d& place) {
  AddBrick(scene, yaw_rad, place);
  scene.shapes.push_back(reference::Cuboid(
      kBrick, {200, 30, 30}, reference::MakePose(0, Eigen::Vector3d::UnitZ(), {0.045, 0.02, 0.075}),
      {0.025, 0.03, 0.03}));
}
inline void AddBall(reference::Scene& scene, const Eigen::Vector3d& place) {
  scene.shapes.push_back(reference::Sphere(kBall, {30, 30, 200}, Eigen::Vector3d::Zero(), 0.055));
  scene.T_WO[kBall] = reference::MakePose(0, Eigen::Vector3d::UnitZ(), place);
}
inline void AddTray(reference::Scene& scene, double yaw_rad, const Eigen::Vector3d& place) {
  scene.shapes.push_back(
      reference::Cuboid(kTray, {30, 180, 30}, Pose::Identity(), {0.10, 0.08, 0.016}));
  scene.T_WO[kTray] = reference::MakePose(yaw_rad, Eigen::Vector3d::UnitZ(), place);
}

inline reference::Scene TableWithToys() {
  reference::Scene scene = TableOnly();
  AddBrick(scene, 0.3, {-0.14, 0.03, kTableTop_m + 0.045});
  AddBall(scene, {0.12, -0.08, kTableTop_m + 0.055});
  AddTray(scene, -0.4, {0.08, 0.11, kTableTop_m + 0.016});
  return scene;
}

// A camera that circles the table at 60 cm and looks down on it.
inline Pose CircleCamera(double angle_rad, double height_m = 0.42) {
  return reference::LookAt({0.45 * std::cos(angle_rad), 0.45 * std::sin(angle_rad), height_m},
                           {0.01, 0.02, 0.03});
}

// Background pixels without a hit get no depth, and so say nothing about what is beyond the table.
inline Frame RenderToys(const reference::Scene& scene, double camera_angle_rad, int index = 1) {
  return reference::Render(scene, CircleCamera(camera_angle_rad), index);
}

// Keyed random numbers in a row.
class Dice {
 public:
  explicit Dice(std::uint64_t seed) : seed_(seed) {}
  double Uniform(double low, double high) {
    return low + (high - low) * UniformDraw(seed_, 1, drawn_++)[0];
  }
  int Whole(int count) { return static_cast<int>(Uniform(0, count)); }

 private:
  std::uint64_t seed_;
  std::uint64_t drawn_ = 0;
};

}  // namespace tsdfpp
