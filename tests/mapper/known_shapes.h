// Shapes whose distances are known exactly, as a map has them and as a camera sees them, for tests
// of registration.
#pragma once

#include <vector>

#include "core/units.h"
#include "mapper/track/sdf_registration.h"
#include "tests/reference/analytic_scene.h"
#include "tests/reference/sdf_registration_reference.h"

namespace tsdfpp {

using Points = std::vector<Eigen::Vector3d>;

inline constexpr double kVoxel_m = 0.01;
inline const Eigen::Vector3d kEye(0.5, -0.6, 0.7);  // of the camera, in the object's frame
// A torus is smooth: what is left is of the third order in a voxel over its tube's radius of four.
inline constexpr double kSmooth_voxels = 0.02;
// Beside an edge, points lie between voxels on both sides of it, whose distances bend.
inline constexpr double kEdges_voxels = 0.05;
// Over shapes of some 8 cm.
inline constexpr double kSmooth_rad = kSmooth_voxels * kVoxel_m / 0.08;
inline constexpr double kEdges_rad = kEdges_voxels * kVoxel_m / 0.08;

// Observed everywhere, without truncation.
inline TsdfGrid GridOf(const reference::DistanceFunction& distance, int reach_voxels = 24) {
  TsdfGrid grid;
  const int blocks = reach_voxels / kBlockSide;
  for (int i = 0; i < 8 * blocks * blocks * blocks; ++i) {
    const Index3 index{i % (2 * blocks) - blocks, i / (2 * blocks) % (2 * blocks) - blocks,
                       i / (4 * blocks * blocks) - blocks};
    TsdfBlock& block = grid.FindOrAdd(index);
    for (int place = 0; place < kBlockVoxels; ++place) {
      const Index3 voxel = VoxelAt(index, place);
      const Eigen::Vector3d p = kVoxel_m * Eigen::Vector3d(voxel.x, voxel.y, voxel.z);
      block.distance[static_cast<std::size_t>(place)] = static_cast<float>(distance(p));
      block.weight[static_cast<std::size_t>(place)] = 50;
    }
  }
  return grid;
}

inline Pose TrueLC() { return reference::LookAt(kEye, Eigen::Vector3d::Zero()); }

inline std::vector<SegmentPoint> InCamera(const Points& points_L) {
  std::vector<SegmentPoint> points_C;
  for (const Eigen::Vector3d& p_L : points_L) {
    points_C.push_back({(TrueLC().inverse() * p_L).cast<float>(), {}});
  }
  return points_C;
}

inline SdfRegistration TaskFrom(const SurfaceReader& model, const std::vector<SegmentPoint>& points,
                                const Pose& motion) {
  SdfRegistration task{&model, points, kVoxel_m, reference::SmallCamera()};
  task.T_LC_expected = motion * TrueLC();
  return task;
}

inline double Turn(const Pose& T) { return Eigen::AngleAxisd(T.linear()).angle(); }

inline const Pose kMotion =
    reference::MakePose(4 * kDegree, {0.3, -1, 0.5}, {0.008, -0.009, 0.006});

}  // namespace tsdfpp
