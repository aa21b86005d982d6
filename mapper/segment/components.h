// Connected parts of an image.
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <span>
#include <vector>

namespace tsdfpp {

// The rectangle around pixels of an image with so many columns (row times columns plus column, by
// rows); empty where there are none.
cv::Rect RectangleOf(std::span<const int> pixels, int columns);

// Which neighbours in a row (`right`, a pixel and the next) and in a column (`down`) are connected:
// CV_8UC1, 0 where they are not. The last column and the last row have no next.
struct PixelLinks {
  const cv::Mat& right;
  const cv::Mat& down;
};

// Numbers the parts of the pixels where `member` (CV_8UC1) is not 0, from `first` on in order of
// their first pixels by row, in `labels` (CV_32SC1), whose other pixels stay as they are. Two
// pixels belong together if links between members lead from one to the other. Returns the number
// after the last.
std::int32_t LabelComponents(const cv::Mat& member, const PixelLinks& links, std::int32_t first,
                             cv::Mat& labels);

// Gives every pixel that is 0 in `labels` and where `known` (CV_32FC1) is not 0 the label of the
// pixel from which the fewest links lead to it; of several the first that got there, beginning in
// order of rows. Pixels to which no link leads stay 0. `scratch` keeps memory from call to call.
void GrowLabels(const cv::Mat& known, const PixelLinks& links, cv::Mat& scratch, cv::Mat& labels);

// Pixels of each label, by label; the first is of 0. Labels are below `end`.
std::vector<std::int32_t> CountLabels(const cv::Mat& labels, std::int32_t end);

// Pixels, and square metres as seen head-on, of a part.
struct PartSize {
  std::int64_t pixels = 0;
  double area_m2 = 0;
};

// Sizes by label; the first is of 0. Labels are below `end`; `pixel` is a pixel's width at 1 m.
std::vector<PartSize> MeasureParts(const cv::Mat& labels, const cv::Mat& depth, float pixel,
                                   std::int32_t end);

// Joins each part that is small in either way with the part that shares most links with it, those
// of fewest pixels first (of equal ones the lowest label; of equal shares, too). A small part
// without neighbours becomes 0. Then numbers those that are left from `first` on, in the order that
// they had. `sizes` are the labels' own, `first` is at least 1. Returns the number after the last.
std::int32_t JoinSmall(const PixelLinks& links, const PartSize& least, std::int32_t first,
                       std::vector<PartSize> sizes, cv::Mat& labels);

}  // namespace tsdfpp
