#include "sequence/integer_images.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>

#include "core/types.h"
#include "sequence/image_files.h"

namespace tsdfpp {

cv::Mat DepthFromUnits(const cv::Mat& units, double units_per_m, std::uint16_t no_depth) {
  cv::Mat depth(units.size(), CV_32FC1);
  for (int y = 0; y < units.rows; ++y) {
    const auto* from = units.ptr<std::uint16_t>(y);
    auto* to = depth.ptr<float>(y);
    for (int x = 0; x < units.cols; ++x) {
      to[x] = from[x] == no_depth ? 0.0F : static_cast<float>(from[x] / units_per_m);
    }
  }
  return depth;
}

cv::Mat DepthToUnits(const cv::Mat& depth_m, double units_per_m, std::uint16_t greatest,
                     DepthLoss& loss) {
  cv::Mat units(depth_m.size(), CV_16UC1);
  for (int y = 0; y < depth_m.rows; ++y) {
    const auto* from = depth_m.ptr<float>(y);
    auto* to = units.ptr<std::uint16_t>(y);
    for (int x = 0; x < depth_m.cols; ++x) {
      to[x] = 0;
      if (!IsValidDepth(from[x])) continue;
      const double value = std::round(static_cast<double>(from[x]) * units_per_m);
      if (value > greatest) {
        ++loss.too_far;
      } else if (value < 1) {
        ++loss.too_near;
      } else {
        to[x] = static_cast<std::uint16_t>(value);
      }
    }
  }
  return units;
}

Expected<cv::Mat> ReadIntegerDepth(const std::filesystem::path& path, cv::Size expected,
                                   const std::string& size_source, double units_per_m,
                                   std::uint16_t no_depth) {
  TSDFPP_ASSIGN(const cv::Mat image, ReadImage(path));
  if (image.type() != CV_16UC1) {
    return DataError("{}: depth is {}, expected 16-bit unsigned with 1 channel", path.string(),
                     ImageTypeName(image));
  }
  TSDFPP_RETURN_IF_ERROR(CheckImageSize(image, expected, size_source, path.string()));
  return DepthFromUnits(image, units_per_m, no_depth);
}

Expected<cv::Mat> ReadIds(const std::filesystem::path& path, cv::Size expected,
                          const std::string& size_source) {
  TSDFPP_ASSIGN(const cv::Mat image, ReadImage(path, DecodeAs::kNumbers));
  TSDFPP_RETURN_IF_ERROR(CheckImageSize(image, expected, size_source, path.string()));
  if (image.type() == CV_16UC1) return image;
  return ReadMask(path, expected);
}

IdEnding IdEndingOf(const std::filesystem::path& file) {
  std::string ending = file.extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  constexpr std::array kIds{".png", ".pgm", ".ppm", ".pbm", ".pnm", ".tif", ".tiff", ".bmp"};
  constexpr std::array kOther{".jpg", ".jpeg", ".webp", ".exr"};
  if (std::find(kIds.begin(), kIds.end(), ending) != kIds.end()) return IdEnding::kIds;
  return std::find(kOther.begin(), kOther.end(), ending) != kOther.end() ? IdEnding::kOther
                                                                         : IdEnding::kNone;
}

}  // namespace tsdfpp
