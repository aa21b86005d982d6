#include "sequence/resample.h"

#include <algorithm>
#include <cmath>

namespace tsdfpp {
namespace {

Eigen::Vector2d SamePoint(int x, int y, const Intrinsics& from, const Intrinsics& to) {
  return {(x - to.cx) / to.fx * from.fx + from.cx, (y - to.cy) / to.fy * from.fy + from.cy};
}

// Calls place(x, y, point) for each pixel of `to` whose point lies within the image of `from`.
template <typename Function>
void ForPixels(const Intrinsics& from, const Intrinsics& to, const Function& place) {
  for (int y = 0; y < to.height; ++y) {
    for (int x = 0; x < to.width; ++x) {
      const Eigen::Vector2d point = SamePoint(x, y, from, to);
      if (point.x() > -0.5 && point.y() > -0.5 && point.x() < from.width - 0.5 &&
          point.y() < from.height - 0.5) {
        place(x, y, point);
      }
    }
  }
}

}  // namespace

cv::Mat SampleColour(const cv::Mat& colour, const Intrinsics& from, const Intrinsics& to) {
  cv::Mat sampled = cv::Mat::zeros(to.height, to.width, CV_8UC3);
  ForPixels(from, to, [&](int x, int y, const Eigen::Vector2d& point) {
    const double u = std::clamp(point.x(), 0.0, from.width - 1.0);
    const double v = std::clamp(point.y(), 0.0, from.height - 1.0);
    const int left = static_cast<int>(u);
    const int top = static_cast<int>(v);
    const int right = std::min(left + 1, from.width - 1);
    const int bottom = std::min(top + 1, from.height - 1);
    const double a = u - left;
    const double b = v - top;
    for (int c = 0; c < 3; ++c) {
      const auto at = [&](int row, int column) {
        return static_cast<double>(colour.at<cv::Vec3b>(row, column)[c]);
      };
      const double value = (1 - b) * ((1 - a) * at(top, left) + a * at(top, right)) +
                           b * ((1 - a) * at(bottom, left) + a * at(bottom, right));
      sampled.at<cv::Vec3b>(y, x)[c] = static_cast<std::uint8_t>(std::lround(value));
    }
  });
  return sampled;
}

cv::Mat SampleIds(const cv::Mat& ids, const Intrinsics& from, const Intrinsics& to) {
  cv::Mat sampled = cv::Mat::zeros(to.height, to.width, CV_16UC1);
  ForPixels(from, to, [&](int x, int y, const Eigen::Vector2d& point) {
    const int u = std::clamp(static_cast<int>(std::lround(point.x())), 0, from.width - 1);
    const int v = std::clamp(static_cast<int>(std::lround(point.y())), 0, from.height - 1);
    sampled.at<InstanceId>(y, x) = ids.at<InstanceId>(v, u);
  });
  return sampled;
}

}  // namespace tsdfpp
