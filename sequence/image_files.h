// The three images of a frame as files: 8-bit RGB PNG, 32-bit float EXR, 8-bit grey PNG. What is
// encoded and decoded again has the same bytes.
#pragma once

#include <filesystem>
#include <opencv2/core.hpp>
#include <string>

#include "core/decode_image.h"
#include "core/error.h"

namespace tsdfpp {

// The bytes of the file. `file` is named in errors. Errors: kData where the image has another type
// than its Frame field (core/types.h) or a mask holds an id over 255, kEnvironment where the codec
// fails.
Expected<std::string> EncodeColour(const cv::Mat& colour, const std::string& file);
Expected<std::string> EncodeDepth(const cv::Mat& depth, const std::string& file);  // lossless
Expected<std::string> EncodeMask(const cv::Mat& mask, const std::string& file);

// Errors of the readers, all kData, naming the file: missing, cannot be decoded, of another size
// than `expected` (an empty size accepts any), of another type.

// CV_8UC3, red-green-blue; an alpha channel is dropped. `size_source` says in the error where the
// expected size is from.
Expected<cv::Mat> ReadColour(const std::filesystem::path& path, cv::Size expected,
                             const std::string& size_source = "calibration.txt");
// CV_32FC1, metres; of three equal channels one is taken. Also an error where the median of the
// positive depths says that the unit is the millimetre.
Expected<cv::Mat> ReadDepth(const std::filesystem::path& path, cv::Size expected);
// CV_16UC1 ids from 8-bit grey, or from 8-bit RGB whose channels are equal.
Expected<cv::Mat> ReadMask(const std::filesystem::path& path, cv::Size expected);

// Any image, with the type that it has on disk (channels blue-green-red).
Expected<cv::Mat> ReadImage(const std::filesystem::path& path, DecodeAs as = DecodeAs::kAsItIs);
// ReadColour of an image file's bytes.
Expected<cv::Mat> DecodeColour(const std::string& bytes, const std::string& file);
// The one of two places that is there, the first where none is. Errors: kData where both are.
Expected<std::filesystem::path> OnlyOneOf(const std::filesystem::path& first,
                                          const std::filesystem::path& second);
// The bytes of an image of 8 or 16 bits as it is.
Expected<std::string> EncodePng(const cv::Mat& image, const std::string& file);

// "16-bit unsigned with 1 channel".
std::string ImageTypeName(const cv::Mat& image);
// Errors: kData where the size is not the expected one (an empty one accepts any).
Expected<void> CheckImageSize(const cv::Mat& image, cv::Size expected,
                              const std::string& size_source, const std::string& file);

}  // namespace tsdfpp
