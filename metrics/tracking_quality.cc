#include "metrics/tracking_quality.h"

#include <cmath>

#include "metrics/segmentation.h"

namespace tsdfpp {

TrackingQuality::TrackingQuality(TrackingConfig config) : config_(std::move(config)) {}

bool TrackingQuality::Known(int class_id) const {
  return class_id == config_.ignored_class || (class_id >= 0 && class_id < config_.classes);
}

Expected<void> TrackingQuality::Observe(const cv::Mat& truth, const cv::Mat& prediction) {
  if (truth.type() != CV_32SC1 || prediction.type() != CV_32SC1 ||
      truth.size() != prediction.size()) {
    return DataError(
        "the prediction is {}x{} of OpenCV type {}, the truth {}x{} of type {}: "
        "expected two images of one size, of 32-bit integers",
        prediction.cols, prediction.rows, prediction.type(), truth.cols, truth.rows, truth.type());
  }
  const std::int32_t instance_mask = (1 << config_.instance_bits) - 1;
  for (const auto& [labels, pixels] : CountLabelPairs(truth, prediction)) {
    const auto& [true_label, label] = labels;
    const int true_class = true_label >> config_.instance_bits;
    const int label_class = label >> config_.instance_bits;
    if (!Known(true_class) || !Known(label_class)) {
      return DataError("{} pixels have class {}, expected 0 to {}", pixels,
                       Known(true_class) ? label_class : true_class, config_.classes - 1);
    }
    confusion_[{true_class, label_class}] += pixels;
    const bool true_thing = config_.things.contains(true_class);
    if (true_thing && (true_label & instance_mask) == 0) continue;
    const bool is_thing = config_.things.contains(label_class);
    if (true_thing) true_tubes_[true_label] += pixels;
    if (is_thing) predicted_tubes_[label] += pixels;
    if (true_thing && is_thing) shared_[labels] += pixels;
  }
  return {};
}

TrackingQuality::Scores TrackingQuality::Result() const {
  Scores scores;
  double association = 0;
  for (const auto& [tubes, pixels] : shared_) {
    const auto shared = static_cast<double>(pixels);
    const auto in_truth = static_cast<double>(true_tubes_.at(tubes.first));
    const auto in_prediction = static_cast<double>(predicted_tubes_.at(tubes.second));
    association += shared * (shared / (in_truth + in_prediction - shared)) / in_truth;
  }
  scores.aq = true_tubes_.empty()
                  ? Measured::Undefined("the truth has no instance to follow")
                  : Measured::Of(association / static_cast<double>(true_tubes_.size()));

  std::map<int, std::int64_t> both;
  std::map<int, std::int64_t> in_union;
  for (const auto& [classes, pixels] : confusion_) {
    const auto& [true_class, label_class] = classes;
    // Predictions on the truth's ignored pixels are not held against it.
    if (true_class == config_.ignored_class) continue;
    in_union[true_class] += pixels;
    if (true_class == label_class) {
      both[true_class] += pixels;
    } else if (label_class != config_.ignored_class) {
      in_union[label_class] += pixels;
    }
  }
  double iou = 0;
  for (const auto& [class_id, pixels] : in_union) {
    iou += static_cast<double>(both[class_id]) / static_cast<double>(pixels);
  }
  scores.iou = in_union.empty() ? Measured::Undefined("no pixel has a class")
                                : Measured::Of(iou / static_cast<double>(in_union.size()));
  if (!scores.aq.value) {
    scores.stq = scores.aq;
  } else if (!scores.iou.value) {
    scores.stq = scores.iou;
  } else {
    scores.stq = Measured::Of(std::sqrt(*scores.aq.value * *scores.iou.value));
  }
  return scores;
}

}  // namespace tsdfpp
