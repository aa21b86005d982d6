// Segmentation and tracking quality, STQ (Weber et al. 2021, STEP), by deeplab2's rules.
#pragma once

#include <cstdint>
#include <map>
#include <opencv2/core.hpp>
#include <set>
#include <utility>

#include "core/error.h"
#include "metrics/measured.h"

namespace tsdfpp {

struct TrackingConfig {
  int classes = 1;         // labels have class 0 to classes - 1
  std::set<int> things;    // the classes whose instances are followed
  int ignored_class = -1;  // of the truth: those pixels are left out of IoU; -1 for none
  int instance_bits = 16;  // label = (class << instance_bits) + instance
};

// All is summed over the frames of one sequence, so that an object is one tube: one id throughout.
// Things with instance 0 in the truth are crowds: they have no tube, and what is predicted there
// counts for none.
class TrackingQuality {
 public:
  explicit TrackingQuality(TrackingConfig config);

  // Takes in a frame; images of labels, CV_32SC1. Errors: kData where the sizes differ, the type is
  // another, or a class is neither known nor ignored.
  Expected<void> Observe(const cv::Mat& truth, const cv::Mat& prediction);

  struct Scores {
    Measured stq;  // sqrt(AQ IoU)
    // Association: for each true tube the mean over its pixels of the IoU of their predicted tube
    // with it, then the mean over tubes. Undefined without tubes.
    Measured aq;
    Measured iou;  // mean over the classes that occur
  };
  Scores Result() const;

 private:
  bool Known(int class_id) const;

  TrackingConfig config_;
  std::map<std::pair<int, int>, std::int64_t> confusion_;  // pixels by class: truth, prediction
  std::map<std::int32_t, std::int64_t> true_tubes_;
  std::map<std::int32_t, std::int64_t> predicted_tubes_;
  std::map<std::pair<std::int32_t, std::int32_t>, std::int64_t> shared_;
};

}  // namespace tsdfpp
