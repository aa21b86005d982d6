// The one way from pixels to the bytes of an image file in a format of OpenCV's. (Sequences have
// encoders of their own: sequence/image_encoders.h.)
#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "core/error.h"

namespace tsdfpp {

// The bytes of `image`, whose colours are in the order blue, green, red, in the format of `ending`
// (".png", ".jpg", ".webp"); `parameters` are cv::imencode's. Errors: kEnvironment, beginning with
// `where`: the codecs cannot be loaded, or refuse the image.
Expected<std::string> EncodeImage(const cv::Mat& image, const std::string& ending,
                                  const std::string& where,
                                  const std::vector<int>& parameters = {});

}  // namespace tsdfpp
