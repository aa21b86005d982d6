// The toys in numbers that single precision holds exactly, so that maps of them can be shifted
// without any rounding: voxels of 2^-7 m, cameras that look straight down from multiples of a
// voxel, turns by quarters.
#pragma once

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "mapper/voxel_inspection.h"
#include "tests/mapper/compare_maps.h"
#include "tests/mapper/toy_scene.h"

namespace tsdfpp {

inline constexpr double kDyadicVoxel_m = 1.0 / 128;

inline MapConfig DyadicConfig() {
  MapConfig config = ToyConfig();
  config.voxel_m = kDyadicVoxel_m;
  return config;
}

// About z, by quarters of a turn; every number is 0, 1 or -1.
inline Eigen::Matrix3d QuarterTurns(int quarters) {
  static constexpr int kCos[] = {1, 0, -1, 0};
  const int c = kCos[quarters & 3];
  const int s = kCos[(quarters + 3) & 3];
  Eigen::Matrix3d R;
  R << c, -s, 0, s, c, 0, 0, 0, 1;
  return R;
}

// `voxels` in x and y; z is the same for all, so that motions are of whole voxels.
inline Pose DyadicPose(int quarters, int x_voxels, int y_voxels, double z_m) {
  Pose T_WO = Pose::Identity();
  T_WO.linear() = QuarterTurns(quarters);
  T_WO.translation() = Eigen::Vector3d(x_voxels * kDyadicVoxel_m, y_voxels * kDyadicVoxel_m, z_m);
  return T_WO;
}

// Frame i of the toys: the brick is driven and turned, the camera moves and turns above them.
inline Frame DyadicFrame(int i) {
  reference::Scene scene = TableWithToys();
  scene.T_WO[kBrick] = DyadicPose(i, -18 + 4 * i, 4 - 2 * i, 53.0 / 1024);
  scene.T_WO[kBall] = DyadicPose(0, 15, -10, 63.0 / 1024);
  scene.T_WO[kTray] = DyadicPose(0, 10, 14, 23.0 / 1024);
  Pose T_WC = Pose::Identity();
  T_WC.linear() = QuarterTurns(i) * Eigen::Vector3d(1, -1, -1).asDiagonal();
  T_WC.translation() = Eigen::Vector3d(3 - i, 2 * i, 80 + i) * kDyadicVoxel_m;
  return reference::Render(scene, T_WC, i);
}

// The same images in a world that is shifted, by blocks.
inline Frame Shifted(Frame frame, const Index3& blocks, double voxel_m = kDyadicVoxel_m) {
  const Eigen::Vector3d shift_m =
      Eigen::Vector3d(blocks.x, blocks.y, blocks.z) * (kBlockSide * voxel_m);
  frame.T_WC.translation() += shift_m;
  for (auto& [id, T_WO] : frame.T_WO) T_WO.translation() += shift_m;
  return frame;
}

inline void PoseAndFuse(MapRepresentation& map, const Frame& frame) {
  for (const auto& [id, T_WO] : frame.T_WO) map.SetObjectPose(id, T_WO);
  map.Fuse(frame, frame.mask);
}

inline std::unique_ptr<MapRepresentation> DyadicMap(Method method, int frames,
                                                    const Index3& blocks = {}) {
  auto map = MakeMap(method, DyadicConfig());
  for (int i = 0; i < frames; ++i) PoseAndFuse(*map, Shifted(DyadicFrame(i), blocks));
  return map;
}

inline bool SameBits(const std::optional<VoxelValue>& a, const std::optional<VoxelValue>& b) {
  return a.has_value() == b.has_value() &&
         (!a ||
          (a->distance_m == b->distance_m && a->weight == b->weight && a->colour == b->colour));
}

// Whether every voxel and every list of `map` is in `shifted` as well, so many blocks away, and
// none besides.
inline ::testing::AssertionResult SameContentShifted(const MapRepresentation& map,
                                                     const MapRepresentation& shifted,
                                                     const Index3& blocks) {
  const Eigen::Vector3i shift = kBlockSide * Eigen::Vector3i(blocks.x, blocks.y, blocks.z);
  const auto moved = [&](std::vector<Eigen::Vector3i> voxels) {
    for (Eigen::Vector3i& v : voxels) v += shift;
    return voxels;
  };
  for (const InstanceId id : ToyIds()) {
    const auto observed = VoxelsOf(map).ObservedVoxels(id);
    if (auto same = SameVoxels(VoxelsOf(shifted).ObservedVoxels(id), moved(observed)); !same) {
      return same << " among the observed voxels of object " << id;
    }
    for (const Eigen::Vector3i& v : observed) {
      if (!SameBits(VoxelsOf(shifted).ValueAt(id, v + shift), VoxelsOf(map).ValueAt(id, v))) {
        return ::testing::AssertionFailure() << "object " << id << " at voxel " << Text(v);
      }
    }
  }
  const auto listed = VoxelsOf(map).ListedVoxels();
  if (auto same = SameVoxels(VoxelsOf(shifted).ListedVoxels(), moved(listed)); !same) {
    return same << " among the listed voxels";
  }
  for (const Eigen::Vector3i& v : listed) {
    if (VoxelsOf(shifted).ListAt(v + shift) != VoxelsOf(map).ListAt(v)) {
      return ::testing::AssertionFailure()
             << "voxel " << Text(v) << " lists " << Text(VoxelsOf(shifted).ListAt(v + shift))
             << ", expected " << Text(VoxelsOf(map).ListAt(v));
    }
  }
  return ::testing::AssertionSuccess();
}

}  // namespace tsdfpp
