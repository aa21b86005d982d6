// The one way from an image file to its pixels: the header is looked at first, and what a codec
// says or throws stays inside.
#pragma once

#include <filesystem>
#include <functional>
#include <opencv2/core.hpp>
#include <string>
#include <string_view>

#include "core/error.h"
#include "core/image_header.h"

namespace tsdfpp {

enum class DecodeAs {
  kAsItIs,  // the type on disk; of colours the order is blue, green, red
  kColour,  // CV_8UC3, blue-green-red
  kNumbers  // as it is, of images whose values are the ones on disk
};

// What the caller asks of the header and the file's bytes, before any pixel is made.
using HeaderCheck = std::function<Expected<void>(const ImageHeader&, std::string_view bytes)>;

// As stored: what a JPEG says of turning it is not followed. Errors: kData, beginning with `where`:
// those of ReadImageHeader and of `check`; a TIFF that is to be turned; a JPEG that is cut; for
// kNumbers any JPEG, and values that a decoder stretches; pixels that cannot be decoded, or are of
// another size than the header says. An EXR image is decoded from its file only: see below.
Expected<cv::Mat> DecodeImage(std::string_view bytes, const std::string& where,
                              DecodeAs as = DecodeAs::kAsItIs, const HeaderCheck& check = {});

// The same of a file, EXR too. Errors: also those of ReadFile; "no such image" where there is none.
Expected<cv::Mat> ReadImageFile(const std::filesystem::path& path, DecodeAs as = DecodeAs::kAsItIs,
                                const HeaderCheck& check = {});

}  // namespace tsdfpp
