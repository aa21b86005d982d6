// The dot pattern of a structured-light camera and its matching, after simkinect (docs/sources.md,
// "Dot pattern"): disparity is measured where the dots of a 9x9 window agree, and nowhere else.
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>

namespace tsdfpp {

inline constexpr int kDotCell_px = 3;            // one dot in each cell of this side
inline constexpr int kDotWindow_px = 9;          // side of the window that must agree
inline constexpr double kDotInlier_px = 0.1;     // how near to the window's mean a dot must be
inline constexpr double kDotWeight = 1.2 * 1.2;  // deviations count by 1 / (kDotWeight r^2)
inline constexpr double kDotShare = 1 / 1.2;     // more than this share of the dots must agree
inline constexpr int kDotFill_px = 3;  // a matched dot gives the pixels around it its value
inline constexpr double kDisparityStep_px = 1.0 / 8;

// CV_8UC1, 1 at a dot: one in each 3x3 cell, at a place that (seed, cell) draws. The pattern
// belongs to the camera, so it is the same in all frames.
cv::Mat MakeDotPattern(std::uint64_t seed, cv::Size size);

// `disparity` in pixels, CV_32FC1, <= 0 where unknown; `dots` from MakeDotPattern, of its size.
// A dot whose 9x9 window lies in the image matches where, first, more than kDotShare of the
// window's dots have a disparity and, second, more than that share also deviate from the mean of
// the window's known disparities by less than kDotInlier_px, each deviation divided by
// kDotWeight r^2 (r its distance from the centre in pixels; 1 at the centre). The result, CV_32FC1,
// is at each pixel the disparity at the nearest matched dot within kDotFill_px (the first in
// reading order of several), rounded to kDisparityStep_px, and 0 where there is none.
cv::Mat MatchDots(const cv::Mat& disparity, const cv::Mat& dots);

}  // namespace tsdfpp
