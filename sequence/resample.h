// Images of one camera at the pixels of another that stands at the same place.
#pragma once

#include <opencv2/core.hpp>

#include "core/types.h"

namespace tsdfpp {

// CV_8UC3 of camera `to`, each pixel taken bilinearly from where its ray meets the image of `from`;
// black outside.
cv::Mat SampleColour(const cv::Mat& colour, const Intrinsics& from, const Intrinsics& to);

// The same for CV_16UC1 ids, at the nearest pixel; background outside.
cv::Mat SampleIds(const cv::Mat& ids, const Intrinsics& from, const Intrinsics& to);

}  // namespace tsdfpp
