// Writers of the two image files that a sequence is made of. OpenCV's own take two (PNG)
// to three times (EXR) as long for the same sizes; these hand rows to libdeflate.
#pragma once

#include <opencv2/core.hpp>
#include <string>

namespace tsdfpp {

// A PNG file (RFC 2083) of an image of type CV_8UC1 (grey), CV_8UC3 (red, green, blue) or CV_16UC1
// (grey), not empty; any other aborts.
std::string PngFile(const cv::Mat& image);

// An OpenEXR file (openexr.com, "OpenEXR File Layout") with one channel, Y, of 32-bit floats: the
// image must be CV_32FC1 and not empty, else it aborts. Lossless: every bit of a float returns.
std::string ExrFile(const cv::Mat& image);

}  // namespace tsdfpp
