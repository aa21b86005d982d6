// Segments as people look at them.
#pragma once

#include "core/types.h"

namespace tsdfpp {

// CV_8UC3, red-green-blue, of the size of `ids` (CV_16UC1): each segment in a colour of its id, the
// background grey, kNoInstance black; `colour` (Frame::colour), where it has that size, shines
// through.
cv::Mat SegmentPicture(const cv::Mat& colour, const cv::Mat& ids);

}  // namespace tsdfpp
