// Which pixels of a frame belong together (paper III-B): the first verb of the pipeline.
#pragma once

#include <memory>
#include <string_view>

#include "core/error.h"
#include "core/types.h"

namespace tsdfpp {

class Segmenter {
 public:
  virtual ~Segmenter() = default;

  // The segment of each pixel: CV_16UC1 of the depth image's size; kBackground is what the room is
  // made of, kNoInstance what belongs to no segment and is not fused. May share its pixels with the
  // frame. Errors: kData, a sentence that begins with the frame's number.
  virtual Expected<cv::Mat> Segment(const Frame& frame) = 0;
};

enum class Segmentation {
  kGiven,  // Frame::mask
  kNone,   // Frame::mask is not read
};

// "gt" or "none". Errors: kUsage.
Expected<Segmentation> SegmentationFromName(std::string_view name);
std::string_view SegmentationName(Segmentation segmentation);

std::unique_ptr<Segmenter> MakeSegmenter(Segmentation segmentation);

}  // namespace tsdfpp
