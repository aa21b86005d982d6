#include "eval/picture/segment_picture.h"

#include <algorithm>
#include <cmath>

namespace tsdfpp {
namespace {

constexpr double kOpaque = 0.6;

// Hues a golden section apart, so that ids near one another look different.
cv::Vec3b ColourOfId(InstanceId id) {
  if (id == kNoInstance) return {0, 0, 0};
  if (id == kBackground) return {70, 70, 70};
  const double hue = std::fmod(0.618033988749895 * id, 1.0) * 6;
  const auto channel = [&](double at) {
    const double away = std::abs(std::fmod(hue - at + 9, 6.0) - 3);  // 0 at the channel's own hue
    return static_cast<std::uint8_t>(40 + 215 * std::clamp(2 - away, 0.0, 1.0));
  };
  return {channel(0), channel(2), channel(4)};
}

}  // namespace

cv::Mat SegmentPicture(const cv::Mat& colour, const cv::Mat& ids) {
  cv::Mat picture(ids.size(), CV_8UC3);
  const bool has_colour = colour.type() == CV_8UC3 && colour.size() == ids.size();
  for (int v = 0; v < ids.rows; ++v) {
    const auto* id = ids.ptr<InstanceId>(v);
    auto* to = picture.ptr<cv::Vec3b>(v);
    for (int u = 0; u < ids.cols; ++u) {
      to[u] = ColourOfId(id[u]);
      if (!has_colour || id[u] == kNoInstance) continue;
      const auto& behind = colour.ptr<cv::Vec3b>(v)[u];
      for (int c = 0; c < 3; ++c) {
        to[u][c] = static_cast<std::uint8_t>(kOpaque * to[u][c] + (1 - kOpaque) * behind[c]);
      }
    }
  }
  return picture;
}

}  // namespace tsdfpp
