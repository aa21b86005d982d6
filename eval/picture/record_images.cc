#include "eval/picture/record_images.h"

#include <algorithm>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "core/encode_image.h"
#include "eval/picture/draw_scene.h"

namespace tsdfpp {
namespace {

constexpr int kWebpQuality = 82;
constexpr int kMostWebpSide_px = 16383;  // the format's own limit
constexpr int kWebpLossless = 101;       // what OpenCV takes above 100

}  // namespace

cv::Mat Scaled(const cv::Mat& image, double scale, int interpolation) {
  cv::Mat scaled;
  if (std::min(image.cols, image.rows) * scale > 0.5) {  // which is rounded to 1
    cv::resize(image, scaled, {}, scale, scale, interpolation);
    return scaled;
  }
  // A strip keeps a row of pixels.
  const auto side = [&](int pixels) { return std::max(1, static_cast<int>(pixels * scale)); };
  cv::resize(image, scaled, {side(image.cols), side(image.rows)}, 0, 0, interpolation);
  return scaled;
}

cv::Mat Smaller(const cv::Mat& image, double width, int interpolation) {
  return Scaled(image, std::min(1.0, width / image.cols), interpolation);
}

cv::Mat DrawDepth(const cv::Mat& depth, float nearest_m, float farthest_m) {
  cv::Mat grey;
  depth.convertTo(grey, CV_8U, -255.0 / (farthest_m - nearest_m),
                  255.0 * farthest_m / (farthest_m - nearest_m));
  cv::Mat bgr;
  cv::applyColorMap(grey, bgr, cv::COLORMAP_TURBO);
  cv::Mat rgb;
  cv::cvtColor(bgr, rgb, cv::COLOR_BGR2RGB);
  for (int v = 0; v < depth.rows; ++v) {
    for (int u = 0; u < depth.cols; ++u) {
      if (!IsValidDepth(depth.at<float>(v, u))) rgb.at<cv::Vec3b>(v, u) = {0, 0, 0};
    }
  }
  return rgb;
}

cv::Mat DrawMask(const cv::Mat& mask) {
  cv::Mat rgb(mask.size(), CV_8UC3);
  for (int v = 0; v < mask.rows; ++v) {
    for (int u = 0; u < mask.cols; ++u) {
      const InstanceId id = mask.at<InstanceId>(v, u);
      const Colour colour = id == kNoInstance ? Colour{0, 0, 0} : ObjectColour(id);
      rgb.at<cv::Vec3b>(v, u) = {colour[0], colour[1], colour[2]};
    }
  }
  return rgb;
}

Expected<std::string> WebpBytes(const cv::Mat& rgb, bool lossless) {
  const int longest = std::max(rgb.cols, rgb.rows);
  if (longest > kMostWebpSide_px) {
    const double scale = static_cast<double>(kMostWebpSide_px) / longest;
    return WebpBytes(Scaled(rgb, scale, lossless ? cv::INTER_NEAREST : cv::INTER_AREA), lossless);
  }
  cv::Mat bgr;
  cv::cvtColor(rgb, bgr, cv::COLOR_RGB2BGR);
  return EncodeImage(bgr, ".webp", "a picture of the record",
                     {cv::IMWRITE_WEBP_QUALITY, lossless ? kWebpLossless : kWebpQuality});
}

}  // namespace tsdfpp
