// Images of numbers, as other programs write their masks.
#pragma once

#include <filesystem>
#include <opencv2/core.hpp>

#include "core/error.h"

namespace tsdfpp {

// Numbers of an image (CV_32SC1): 8 or 16 bits, one channel or three equal ones; with `rgb_id` R +
// 256 G + 65536 B. Errors: kData where it cannot be read or is of another kind.
Expected<cv::Mat> ReadNumbers(const std::filesystem::path& path, bool rgb_id);

}  // namespace tsdfpp
