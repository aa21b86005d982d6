#include "mapper/track/segment_points.h"

#include <algorithm>
#include <cmath>

#include "core/pixel_ray.h"
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

// Keeps the label of pixels whose neighbours within `erosion_px` columns have it too; others, and
// the background, become kNoInstance. Returns the columns from the first label on to the last, and
// calls of_label(label) for each run of a label.
template <typename OfLabel>
cv::Range ErodeRow(const InstanceId* row, int cols, int erosion_px, InstanceId* to,
                   const OfLabel& of_label) {
  cv::Range kept(cols, 0);
  for (int begin = 0; begin < cols;) {
    int end = begin;
    while (end < cols && row[end] == row[begin]) ++end;
    const int first = begin == 0 ? 0 : begin + erosion_px;
    const int last = end == cols ? end : end - erosion_px;
    const InstanceId label = row[begin] == kBackground ? kNoInstance : row[begin];
    std::fill(to + begin, to + end, kNoInstance);
    begin = end;
    if (label == kNoInstance) continue;
    of_label(label);
    if (first >= last) continue;
    std::fill(to + first, to + last, label);
    kept = {std::min(kept.start, first), last};
  }
  return kept;
}

}  // namespace

std::map<InstanceId, std::vector<int>> PixelsByLabel(const cv::Mat& labels, int erosion_px) {
  std::map<InstanceId, std::vector<int>> pixels;
  InstanceId last = kNoInstance;
  std::vector<int>* of_last = nullptr;
  const auto pixels_of = [&](InstanceId label) -> std::vector<int>& {
    if (label != last) of_last = &pixels[last = label];
    return *of_last;
  };
  cv::Mat eroded(labels.size(), CV_16UC1);
  // For each column, down to which rows above this one the pixels have one label.
  std::vector<int> since(static_cast<std::size_t>(labels.cols), 0);
  std::vector<cv::Range> kept;  // the columns with labels, by row
  for (int v = 0; v < labels.rows + erosion_px; ++v) {
    if (v < labels.rows) {
      const auto* row = labels.ptr<InstanceId>(v);
      kept.push_back(ErodeRow(row, labels.cols, erosion_px, eroded.ptr<InstanceId>(v), pixels_of));
      const auto* here = eroded.ptr<InstanceId>(v);
      const auto* above = eroded.ptr<InstanceId>(std::max(v - 1, 0));
      for (int u = 0; u < labels.cols; ++u) {
        int& of_column = since[static_cast<std::size_t>(u)];
        of_column = here[u] != above[u] ? v : of_column;
      }
    }
    // All that a pixel of this row asks for is known by now.
    const int middle = v - erosion_px;
    if (middle < 0) continue;
    const int first = std::max(0, middle - erosion_px);
    const auto* row = eroded.ptr<InstanceId>(middle);
    const cv::Range& columns = kept[static_cast<std::size_t>(middle)];
    for (int u = columns.start; u < columns.end; ++u) {
      if (row[u] == kNoInstance || since[static_cast<std::size_t>(u)] > first) continue;
      pixels_of(row[u]).push_back(middle * labels.cols + u);
    }
  }
  return pixels;
}

std::vector<SegmentPoint> SegmentPointsOf(const Frame& frame, const std::vector<int>& pixels,
                                          double voxel_m, const SdfTrackConfig& config) {
  const int cols = frame.depth.cols;
  std::vector<cv::Point2i> inside;
  inside.reserve(pixels.size());
  for (const int pixel : pixels) {
    const cv::Point2i at(pixel % cols, pixel / cols);
    const double noise_m = config.Axial_m(frame.depth.at<float>(at.y, at.x));
    const auto max_step_m =
        static_cast<float>(config.max_step_voxels * voxel_m + kNoiseDeviations * noise_m);
    if (IsInside(frame.depth, at.y, at.x, max_step_m)) inside.push_back(at);
  }
  const std::size_t count = std::min(inside.size(), static_cast<std::size_t>(config.max_points));
  const Intrinsics& camera = frame.intrinsics;
  std::vector<SegmentPoint> points;
  points.reserve(count);
  for (std::size_t i = 0; i < count; ++i) {
    const cv::Point2i& pixel = inside[i * inside.size() / count];
    const double z = frame.depth.at<float>(pixel.y, pixel.x);
    const Eigen::Vector3d p_C = z * PixelRay(camera, pixel.x, pixel.y);
    points.push_back({p_C.cast<float>(), pixel});
  }
  return points;
}

}  // namespace tsdfpp
