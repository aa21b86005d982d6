#include "mapper/track/model_sight.h"

#include <cmath>
#include <optional>

#include "core/pixel_ray.h"
#include "mapper/track/block_view.h"
#include "mapper/track/surface_reader.h"
#include "mapper/volume/fusion_kernels.h"

namespace tsdfpp {
namespace {

// Nothing where it is behind the camera, or nearer than `border` pixels to the picture's edge.
std::optional<cv::Point> NearestPixel(const Intrinsics& camera, const Eigen::Vector3d& p_C,
                                      int border) {
  if (!(p_C.z() > double{kNearest_m})) return std::nullopt;
  const Eigen::Vector2d pixel = PixelOf(camera, p_C);
  const double u = std::floor(pixel.x() + 0.5);
  const double v = std::floor(pixel.y() + 0.5);
  if (!(u >= border && v >= border && u < camera.width - border && v < camera.height - border)) {
    return std::nullopt;
  }
  return cv::Point(static_cast<int>(u), static_cast<int>(v));
}

// What the depth around a pixel says of a surface at z_m there.
void Count(const Frame& frame, int u, int v, double z_m, double margin_m, const cv::Mat& may_be,
           ModelSight& sight) {
  bool is_known = false;
  bool is_matched = false;
  bool is_own = false;
  bool is_farther = true;
  for (int b = v - 1; b <= v + 1; ++b) {
    for (int a = u - 1; a <= u + 1; ++a) {
      const float depth_m = frame.depth.at<float>(b, a);
      if (!IsValidDepth(depth_m)) continue;
      is_known = true;
      if (std::abs(double{depth_m} - z_m) <= margin_m) {
        is_matched = true;
        is_own = is_own || may_be.empty() || may_be.at<std::uint8_t>(b, a) != 0;
      }
      is_farther = is_farther && double{depth_m} > z_m + margin_m;
    }
  }
  if (!is_known) return;
  if (is_own) {
    ++sight.matched;
  } else if (is_matched) {
    ++sight.beside;
  } else if (is_farther) {
    ++sight.through;
  } else {
    ++sight.hidden;
  }
}

}  // namespace

ModelSight LookAtModel(const Frame& frame, const TsdfGrid& model, const Pose& T_WL, double voxel_m,
                       double margin_m, const cv::Mat& may_be) {
  ModelSight sight;
  const Pose T_CL = frame.T_WC.inverse() * T_WL;
  const Intrinsics& camera = frame.intrinsics;
  for (const auto& entry : model.entries()) {
    if (IsOutOfView(entry.index, T_CL, voxel_m, camera)) continue;
    ForEachSurfaceVoxel(entry, voxel_m, [&](std::size_t /*place*/, const Index3& voxel) {
      const Eigen::Vector3d p_C = T_CL * (voxel_m * Eigen::Vector3d(voxel.x, voxel.y, voxel.z));
      if (const auto pixel = NearestPixel(camera, p_C, 1)) {
        Count(frame, pixel->x, pixel->y, p_C.z(), margin_m, may_be, sight);
      }
    });
  }
  return sight;
}

FacingVoxels LookAtFacing(const Frame& frame, const cv::Mat& labels, InstanceId id,
                          const TsdfGrid& model, const Pose& T_WL, double voxel_m,
                          double margin_m) {
  FacingVoxels facing;
  const Pose T_CL = frame.T_WC.inverse() * T_WL;
  const Eigen::Vector3d camera_L = T_CL.inverse().translation();
  const Intrinsics& camera = frame.intrinsics;
  const SurfaceReader reader(model, voxel_m);
  VoxelCube cube;
  for (const auto& entry : model.entries()) {
    if (IsOutOfView(entry.index, T_CL, voxel_m, camera)) continue;
    ForEachSurfaceVoxel(entry, voxel_m, [&](std::size_t /*place*/, const Index3& voxel) {
      const Eigen::Vector3d p_L = voxel_m * Eigen::Vector3d(voxel.x, voxel.y, voxel.z);
      SurfaceReader::Linear at;
      if (!reader.LinearAt(p_L, 0, cube, at)) return;
      const Eigen::Vector3d slope(at.slope_x, at.slope_y, at.slope_z);
      const Eigen::Vector3d p_C = T_CL * p_L;
      if (slope.dot(p_L - camera_L) >= 0) return;
      const auto pixel = NearestPixel(camera, p_C, 0);
      if (!pixel) return;
      const float depth_m = frame.depth.at<float>(*pixel);
      const InstanceId label = labels.at<InstanceId>(*pixel);
      if (label == id) {
        ++facing.shown;
      } else if (label != kBackground && IsValidDepth(depth_m) &&
                 p_C.z() - double{depth_m} > margin_m) {
        ++facing.covered;
      }
    });
  }
  return facing;
}

}  // namespace tsdfpp
