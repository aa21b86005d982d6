// Depth and instance ids as 16-bit integers, which all formats but Co-Fusion's use.
#pragma once

#include <cstdint>
#include <filesystem>
#include <opencv2/core.hpp>
#include <string>

#include "core/error.h"

namespace tsdfpp {

// CV_32FC1 metres from CV_16UC1: value / units_per_m, and 0 (invalid) where the value is 0 or
// `no_depth`.
cv::Mat DepthFromUnits(const cv::Mat& units, double units_per_m, std::uint16_t no_depth = 0);

// What does not survive in integers.
struct DepthLoss {
  long too_far = 0;   // pixels whose depth is over the greatest value: written as 0
  long too_near = 0;  // pixels whose depth rounds to 0
};

// CV_16UC1 from CV_32FC1 metres: rounded to the nearest unit, 0 where the depth is invalid
// (core/types.h) or over `greatest` units. A depth that is kept is off by 0.5 / units_per_m at
// most. Adds to `loss`.
cv::Mat DepthToUnits(const cv::Mat& depth_m, double units_per_m, std::uint16_t greatest,
                     DepthLoss& loss);

// A 16-bit grey image as metres. Errors: kData, naming the file: missing, cannot be decoded, of
// another type (8-bit or float depth, colours) or size.
Expected<cv::Mat> ReadIntegerDepth(const std::filesystem::path& path, cv::Size expected,
                                   const std::string& size_source, double units_per_m,
                                   std::uint16_t no_depth = 0);

// What a file's ending, in whatever case, says of ids in it.
enum class IdEnding {
  kNone,   // it is no image
  kOther,  // an image that changes ids or cannot hold them
  kIds     // .png, .pgm, .ppm, .pbm, .pnm, .tif, .tiff or .bmp
};
IdEnding IdEndingOf(const std::filesystem::path& file);

// CV_16UC1 ids from 8-bit or 16-bit grey, or 8-bit RGB with equal channels. An empty size accepts
// any.
Expected<cv::Mat> ReadIds(const std::filesystem::path& path, cv::Size expected,
                          const std::string& size_source);

}  // namespace tsdfpp
