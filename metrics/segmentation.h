// Panoptic quality and label overlap of images of ids.
#pragma once

#include <cstdint>
#include <map>
#include <opencv2/core.hpp>
#include <set>
#include <utility>
#include <vector>

#include "core/error.h"
#include "metrics/measured.h"

namespace tsdfpp {

// Pixels of each pair (label of the truth, label of the prediction). Both images are CV_32SC1 and
// of one size.
using LabelPairs = std::map<std::pair<std::int32_t, std::int32_t>, std::int64_t>;
LabelPairs CountLabelPairs(const cv::Mat& truth, const cv::Mat& prediction);

struct PanopticSegment {
  std::int32_t id = 0;  // in the image; never kVoid
  int class_id = 0;
  // Of a truth: a region of many instances that nobody told apart. It is not looked for, and what
  // is predicted in it is not held against the prediction.
  bool is_crowd = false;
};

inline constexpr std::int32_t kVoid = 0;  // pixels of which nothing is known

struct PanopticImage {
  cv::Mat ids;  // CV_32SC1
  std::vector<PanopticSegment> segments;
};

// Segments of an image of labels (CV_32SC1), value = class * divisor + instance: each value that
// occurs is one. Class 0 is void.
PanopticImage SegmentsOfLabels(const cv::Mat& labels, std::int32_t divisor);

struct ClassCounts {
  std::int64_t true_positives = 0;
  std::int64_t false_positives = 0;
  std::int64_t false_negatives = 0;
  double iou_sum = 0;  // over the true positives
};
using PanopticCounts = std::map<int, ClassCounts>;  // by class
void Add(const PanopticCounts& more, PanopticCounts& to);

// One image, by panopticapi's rules (Kirillov et al. 2019). A predicted and a true segment of one
// class match where their IoU is above 1/2; what a predicted segment covers of the truth's void is
// left out of the union. True segments without a match are false negatives, crowds aside. A
// predicted segment without a match is a false positive unless more than half of it lies on void or
// on crowds of its own class. Errors: kData where the images differ in size or are not CV_32SC1,
// where an id is in an image but not among its segments, or a predicted segment is not in its
// image.
Expected<PanopticCounts> CountPanoptic(const PanopticImage& truth, const PanopticImage& prediction);

struct PanopticQuality {
  Measured pq;  // iou_sum / (TP + FP/2 + FN/2) = SQ RQ
  Measured sq;  // iou_sum / TP: undefined without true positives
  Measured rq;  // TP / (TP + FP/2 + FN/2)
};
// Undefined where the class has neither true nor predicted segments.
PanopticQuality QualityOf(const ClassCounts& counts);

// Means over the classes that have any segment, as panopticapi takes them: a class without true
// positives counts with SQ 0. Undefined where there is no such class.
struct MeanPanopticQuality {
  PanopticQuality mean;
  int classes = 0;
};
MeanPanopticQuality MeanQuality(const PanopticCounts& counts);
// Over those of `classes` only, e.g. the things.
MeanPanopticQuality MeanQuality(const PanopticCounts& counts, const std::set<int>& classes);

// Intersection over union of labels, followed through a sequence (docs/sources.md, "Segmentation").
class LabelOverlap {
 public:
  // Takes in a frame: images of labels, CV_32SC1, of one size (a programmer's duty). Pixels that
  // the truth labels `ignored` are left out; those that the prediction alone labels so have no
  // label, which is missed in the truth's.
  void Observe(const cv::Mat& truth, const cv::Mat& prediction, std::int32_t ignored = -1);

  // Sum of intersections / sum of unions over all frames, for each label of either.
  std::map<std::int32_t, double> ByLabel() const;
  // Mean over the frames of the mean IoU of the labels in a frame (in either image).
  Measured PerFrameMean() const;

 private:
  struct Areas {
    std::int64_t intersection = 0;
    std::int64_t in_union = 0;
  };
  std::map<std::int32_t, Areas> areas_;
  double frame_means_ = 0;
  int frames_ = 0;
};

}  // namespace tsdfpp
