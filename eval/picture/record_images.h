// Small images of a recording (eval/compare/report_record.h); all are CV_8UC3, red-green-blue.
#pragma once

#include <opencv2/core.hpp>
#include <string>

#include "core/error.h"

namespace tsdfpp {

// The image with its sides times `scale`, each one pixel at least.
cv::Mat Scaled(const cv::Mat& image, double scale, int interpolation);

// `width` pixels wide, or as it is where it is not wider.
cv::Mat Smaller(const cv::Mat& image, double width, int interpolation);

// Near is warm, far is cold, what was not measured is black. `depth` in metres, CV_32FC1.
cv::Mat DrawDepth(const cv::Mat& depth, float nearest_m, float farthest_m);

// A colour an object (ObjectColour); black where there is none. `mask` is CV_16UC1.
cv::Mat DrawMask(const cv::Mat& mask);

// The image as a WebP file. Errors: kEnvironment where OpenCV cannot make it.
Expected<std::string> WebpBytes(const cv::Mat& rgb, bool lossless);

}  // namespace tsdfpp
