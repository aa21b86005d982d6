#include "mapper/track/block_view.h"

#include <array>
#include <numbers>

namespace tsdfpp {

bool IsOutOfView(const Index3& block, const Pose& T_CL, double voxel_m, const Intrinsics& camera) {
  // From the middle of a block's voxels to those at its corners.
  constexpr double kHalf_voxels = (kBlockSide - 1) / 2.0;
  const double radius_m = std::numbers::sqrt3 * kHalf_voxels * voxel_m;
  const Eigen::Vector3d corner = double{kBlockSide} * Eigen::Vector3d(block.x, block.y, block.z);
  const Eigen::Vector3d middle_C =
      T_CL * (voxel_m * (corner + Eigen::Vector3d::Constant(kHalf_voxels)));
  if (middle_C.z() < -radius_m) return true;
  // The planes through the camera and the edges of the picture, half a pixel out; normals inwards.
  const double left = camera.cx + 0.5;
  const double top = camera.cy + 0.5;
  const std::array<Eigen::Vector3d, 4> sides{
      Eigen::Vector3d(camera.fx, 0, left), Eigen::Vector3d(-camera.fx, 0, camera.width - left),
      Eigen::Vector3d(0, camera.fy, top), Eigen::Vector3d(0, -camera.fy, camera.height - top)};
  for (const Eigen::Vector3d& side : sides) {
    if (side.dot(middle_C) < -radius_m * side.norm()) return true;
  }
  return false;
}

}  // namespace tsdfpp
