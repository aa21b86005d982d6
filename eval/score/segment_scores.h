// Scores the segments of frames, whose ids mean nothing from frame to frame, against true masks
// (docs/segmentation.md, "Scores").
#pragma once

#include <map>
#include <nlohmann/json.hpp>

#include "core/error.h"
#include "core/types.h"
#include "metrics/segmentation.h"

namespace tsdfpp {

struct SegmentScores {
  int frames = 0;
  // Mean over the frames of the mean over a frame's true segments of the greatest IoU that a
  // predicted segment has with it: the background's with the background, objects' with others.
  Measured mean_iou;
  // Matched one to one (IoU above 1/2) whatever their ids are; the background is one stuff segment,
  // which matches the background only.
  PanopticQuality quality;     // of all
  PanopticQuality background;  // of the background
  PanopticQuality objects;     // of the rest
  // Each predicted segment is given to the true one with which it shares most pixels, frame by
  // frame; the IoU of an object is then of sums over the frames. What a perfect association makes
  // of the segments.
  std::map<InstanceId, double> iou;
  Measured sequence_iou;  // the mean of these
};

class SegmentScorer {
 public:
  // `truth` and `ids`: CV_16UC1. Pixels without valid depth (CV_32FC1) are left out. Of those that
  // the truth calls kNoInstance nothing is known: what a segment has of them is not held against
  // it (CountPanoptic's void). In `ids` kNoInstance belongs to no segment. Errors: kData where the
  // images are of other types or differ in size.
  Expected<void> Observe(const cv::Mat& truth, const cv::Mat& ids, const cv::Mat& depth);
  SegmentScores Result() const;

 private:
  PanopticCounts counts_;
  double iou_sum_ = 0;  // of frames' means
  int frames_ = 0;
  std::map<InstanceId, std::int64_t> shared_;
  std::map<InstanceId, std::int64_t> united_;
};

nlohmann::json ToJson(const SegmentScores& scores);

}  // namespace tsdfpp
