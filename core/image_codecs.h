// OpenCV's codecs of images, in a library of their own that is loaded with the first image.
#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "core/error.h"

namespace tsdfpp {

// cv::imread, cv::imdecode and cv::imencode, which throw what those throw.
struct ImageCodecs {
  cv::Mat (*read)(const std::string& path, int flags);
  cv::Mat (*decode)(const cv::Mat& bytes, int flags);
  bool (*encode)(const std::string& ending, const cv::Mat& image, std::vector<unsigned char>& bytes,
                 const std::vector<int>& parameters);
};

// Errors: kEnvironment, the library cannot be loaded, which the next call tries again.
Expected<ImageCodecs> LoadImageCodecs();

}  // namespace tsdfpp
