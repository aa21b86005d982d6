#include "mapper/network/mask_rcnn.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <opencv2/imgproc.hpp>
#include <span>

#include "mapper/network/yolo_masks.h"

namespace tsdfpp {
namespace {

constexpr double kLeastScore = 0.5;
constexpr int kFields = 7;

cv::Rect PixelsOfBox(std::span<const float> row, cv::Size image) {
  const auto pixel = [](float share, int side) {
    return static_cast<int>(
        std::clamp(std::round(static_cast<double>(share) * side), 0.0, static_cast<double>(side)));
  };
  const int left = pixel(row[3], image.width);
  const int top = pixel(row[4], image.height);
  const int right = pixel(row[5], image.width);
  const int bottom = pixel(row[6], image.height);
  return {left, top, right - left, bottom - top};
}

}  // namespace

Expected<std::vector<Instance>> InstancesOfMaskRcnn(const NetworkOutput& detections,
                                                    const NetworkOutput& masks, cv::Size image,
                                                    const std::vector<std::string>& classes,
                                                    const NetworkConfig& config) {
  const auto& sides = detections.sides;
  if (sides.size() != 4 || sides[0] != 1 || sides[1] != 1 || sides[3] != kFields) {
    return DataError("its detections are {}, expected 1x1xNx7", detections.Shape());
  }
  if (masks.sides.size() != 4) {
    return DataError("its masks are {}, expected NxCxHxW", masks.Shape());
  }
  const int mask_classes = masks.sides[1];
  const int height = masks.sides[2];
  const int width = masks.sides[3];
  const double least_score = config.least_score > 0 ? config.least_score : kLeastScore;
  std::vector<Instance> instances;
  for (int i = 0; i < sides[2] && instances.size() < kMostInstances; ++i) {
    const std::span<const float> row(detections.values + static_cast<std::ptrdiff_t>(i) * kFields,
                                     kFields);
    if (!(row[2] >= least_score) ||
        !std::all_of(row.begin(), row.end(), [](float value) { return std::isfinite(value); })) {
      continue;
    }
    const int number = static_cast<int>(std::clamp(row[1], -1.0F, 1e6F));
    if (number < 0 || number >= mask_classes) {
      return DataError("a detection has class {}, expected 0 to {}", row[1], mask_classes - 1);
    }
    if (i >= masks.sides[0]) {
      return DataError("its masks are {}, expected one of detection {}", masks.Shape(), i + 1);
    }
    const cv::Rect box = PixelsOfBox(row, image);
    if (box.empty()) continue;
    const std::ptrdiff_t plane = static_cast<std::ptrdiff_t>(i) * mask_classes + number;
    // OpenCV has no view of constant values; nothing is written.
    const cv::Mat small(height, width, CV_32FC1,
                        const_cast<float*>(masks.values) +  // NOLINT(*-const-cast)
                            plane * height * width);
    cv::Mat large;
    cv::resize(small, large, box.size(), 0, 0, cv::INTER_LINEAR);
    const cv::Mat mask = large > config.mask_share;
    if (cv::countNonZero(mask) == 0) continue;
    const auto place = static_cast<std::size_t>(number);
    instances.push_back({box, mask,
                         place < classes.size() ? classes[place] : fmt::format("class {}", number),
                         std::min(row[2], 1.0F)});
  }
  return instances;
}

}  // namespace tsdfpp
