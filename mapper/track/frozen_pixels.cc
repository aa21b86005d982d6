#include "mapper/track/frozen_pixels.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include "core/pixel_ray.h"
#include "mapper/track/block_view.h"
#include "mapper/track/object_model.h"
#include "mapper/volume/fusion_kernels.h"

namespace tsdfpp {
namespace {

// The pixels that the voxels of a block fall on; the whole image where it surrounds the camera's
// own place.
cv::Rect PixelsOf(const Index3& block, const Pose& T_CL, double voxel_m, const Intrinsics& camera) {
  if (IsOutOfView(block, T_CL, voxel_m, camera)) return {};
  const cv::Rect image(0, 0, camera.width, camera.height);
  double left = camera.width;
  double top = camera.height;
  double right = 0;
  double bottom = 0;
  int behind = 0;
  for (int i = 0; i < 8; ++i) {
    const Index3 corner =
        VoxelAt(block, (i & 1) * 7 + ((i >> 1) & 1) * 7 * kBlockSide + (i >> 2) * 7 * 64);
    const Eigen::Vector3d p_C = T_CL * (voxel_m * Eigen::Vector3d(corner.x, corner.y, corner.z));
    if (p_C.z() < double{kNearest_m}) {
      ++behind;
      continue;
    }
    const Eigen::Vector2d pixel = PixelOf(camera, p_C);
    left = std::min(left, std::floor(pixel.x()));
    right = std::max(right, std::ceil(pixel.x()) + 1);
    top = std::min(top, std::floor(pixel.y()));
    bottom = std::max(bottom, std::ceil(pixel.y()) + 1);
  }
  if (behind == 8) return {};
  if (behind > 0) return image;
  const auto clamped = [](double x, int end) {
    return static_cast<int>(std::clamp(x, 0.0, static_cast<double>(end)));
  };
  const cv::Point low(clamped(left, camera.width), clamped(top, camera.height));
  const cv::Point high(clamped(right, camera.width), clamped(bottom, camera.height));
  if (high.x <= low.x || high.y <= low.y) return {};
  return {low, high};
}

}  // namespace

cv::Mat LabelsToFuse(const Frame& frame, const cv::Mat& labels, const MapRepresentation& map,
                     const TrackedPoses& tracked) {
  std::vector<bool> is_frozen;  // by id
  for (const auto& [id, status] : tracked.seen) {
    if (status != TrackStatus::kFrozen) continue;
    is_frozen.resize(std::size_t{kNoInstance} + 1);
    is_frozen[id] = true;
  }
  if (is_frozen.empty()) return labels;
  // Of all at once: a frame may show as many objects as there are ids.
  cv::Mat fused = labels.clone();
  for (int v = 0; v < fused.rows; ++v) {
    auto* row = fused.ptr<InstanceId>(v);
    for (int u = 0; u < fused.cols; ++u) {
      if (is_frozen[row[u]]) row[u] = kNoInstance;
    }
  }
  if (IsOneField(map.method())) return fused;
  for (const auto& [id, status] : tracked.seen) {
    if (status != TrackStatus::kFrozen) continue;
    const std::optional<ObjectModel> model = ModelOf(map, id);
    if (!model) continue;
    const Pose T_CL = frame.T_WC.inverse() * model->T_WL;
    for (const auto& entry : model->grid->entries()) {
      if (!entry.block->AnyNegative()) continue;
      const cv::Rect pixels = PixelsOf(entry.index, T_CL, map.config().voxel_m, frame.intrinsics);
      fused(pixels).setTo(static_cast<double>(kNoInstance));
      if (pixels.size() == fused.size()) return fused;
    }
  }
  return fused;
}

}  // namespace tsdfpp
