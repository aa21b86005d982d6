#include "mapper/track/segment_points.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace tsdfpp {
namespace {

// Whether depth goes on without a step from a pixel to the four beside it.
bool IsInside(const cv::Mat& depth, int v, int u, float max_step_m) {
  const float z = depth.at<float>(v, u);
  if (!IsValidDepth(z)) return false;
  const auto goes_on = [&](int row, int column) {
    if (row < 0 || column < 0 || row >= depth.rows || column >= depth.cols) return true;
    const float beside = depth.at<float>(row, column);
    return IsValidDepth(beside) && std::abs(beside - z) <= max_step_m;
  };
  return goes_on(v - 1, u) && goes_on(v + 1, u) && goes_on(v, u - 1) && goes_on(v, u + 1);
}

}  // namespace

std::map<InstanceId, cv::Rect> BoxesOf(const cv::Mat& labels) {
  std::map<InstanceId, cv::Rect> boxes;
  for (int v = 0; v < labels.rows; ++v) {
    const auto* row = labels.ptr<InstanceId>(v);
    for (int u = 0; u < labels.cols;) {
      const int begin = u;
      const InstanceId id = row[u];
      while (u < labels.cols && row[u] == id) ++u;
      if (id != kNoInstance) boxes[id] |= cv::Rect(begin, v, u - begin, 1);
    }
  }
  return boxes;
}

std::vector<SegmentPoint> SegmentPointsOf(const Frame& frame, const cv::Mat& labels, InstanceId id,
                                          const cv::Rect& box, double voxel_m,
                                          const SdfTrackConfig& config) {
  // With a rim of its surroundings, so that erosion sees them.
  const int rim = config.mask_erosion_px;
  const cv::Rect window =
      cv::Rect(box.x - rim, box.y - rim, box.width + 2 * rim, box.height + 2 * rim) &
      cv::Rect(0, 0, labels.cols, labels.rows);
  cv::Mat mask = labels(window) == static_cast<double>(id);
  if (rim > 0) {
    cv::erode(mask, mask, cv::getStructuringElement(cv::MORPH_RECT, {2 * rim + 1, 2 * rim + 1}));
  }
  const auto max_step_m = static_cast<float>(config.max_step_voxels * voxel_m);
  std::vector<cv::Point2i> pixels;
  pixels.reserve(static_cast<std::size_t>(box.area()));
  for (int row = 0; row < mask.rows; ++row) {
    const auto* is_mine = mask.ptr<std::uint8_t>(row);
    for (int column = 0; column < mask.cols; ++column) {
      if (is_mine[column] == 0) continue;
      const cv::Point2i pixel(window.x + column, window.y + row);
      if (IsInside(frame.depth, pixel.y, pixel.x, max_step_m)) pixels.push_back(pixel);
    }
  }
  const std::size_t count = std::min(pixels.size(), static_cast<std::size_t>(config.max_points));
  const Intrinsics& camera = frame.intrinsics;
  std::vector<SegmentPoint> points;
  points.reserve(count);
  for (std::size_t i = 0; i < count; ++i) {
    const cv::Point2i& pixel = pixels[i * pixels.size() / count];
    const double z = frame.depth.at<float>(pixel.y, pixel.x);
    const Eigen::Vector3d p_C((pixel.x - camera.cx) / camera.fx * z,
                              (pixel.y - camera.cy) / camera.fy * z, z);
    points.push_back({p_C.cast<float>(), pixel});
  }
  return points;
}

}  // namespace tsdfpp
