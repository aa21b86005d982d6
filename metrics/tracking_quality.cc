#include "metrics/tracking_quality.h"

#include <cmath>

namespace tsdfpp {

TrackingQuality::TrackingQuality(TrackingConfig config)
    : config_(std::move(config)),
      size_(static_cast<std::size_t>(config_.classes) + 1),
      confusion_(size_ * size_, 0) {}

std::size_t TrackingQuality::Row(int class_id) const {
  if (class_id == config_.ignored_class) return size_ - 1;
  if (class_id < 0 || class_id >= config_.classes) return size_;
  return static_cast<std::size_t>(class_id);
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
  for (int y = 0; y < truth.rows; ++y) {
    for (int x = 0; x < truth.cols; ++x) {
      const std::int32_t true_label = truth.at<std::int32_t>(y, x);
      const std::int32_t label = prediction.at<std::int32_t>(y, x);
      const int true_class = true_label >> config_.instance_bits;
      const int label_class = label >> config_.instance_bits;
      const std::size_t row = Row(true_class);
      const std::size_t column = Row(label_class);
      if (row == size_ || column == size_) {
        return DataError("pixel {},{} has class {}, expected 0 to {}", x, y,
                         row == size_ ? true_class : label_class, config_.classes - 1);
      }
      ++confusion_[row * size_ + column];
      const bool true_thing = config_.things.contains(true_class);
      if (true_thing && (true_label & instance_mask) == 0) continue;
      const bool is_thing = config_.things.contains(label_class);
      if (true_thing) ++true_tubes_[true_label];
      if (is_thing) ++predicted_tubes_[label];
      if (true_thing && is_thing) ++shared_[{true_label, label}];
    }
  }
  return {};
}

TrackingQuality::Scores TrackingQuality::Result() const {
  Scores scores;
  double association = 0;
  for (const auto& [tubes, pixels] : shared_) {
    const auto both = static_cast<double>(pixels);
    const auto in_truth = static_cast<double>(true_tubes_.at(tubes.first));
    const auto in_prediction = static_cast<double>(predicted_tubes_.at(tubes.second));
    association += both * (both / (in_truth + in_prediction - both)) / in_truth;
  }
  scores.aq = true_tubes_.empty()
                  ? Measured::Undefined("the truth has no instance to follow")
                  : Measured::Of(association / static_cast<double>(true_tubes_.size()));

  double iou = 0;
  int occurring = 0;
  for (std::size_t k = 0; k + 1 < size_; ++k) {
    std::int64_t in_truth = 0;
    std::int64_t in_prediction = 0;
    for (std::size_t other = 0; other < size_; ++other) {
      in_truth += confusion_[k * size_ + other];
      // Predictions on the truth's ignored pixels, its last row, are not held against it.
      if (other + 1 < size_) in_prediction += confusion_[other * size_ + k];
    }
    const std::int64_t both = confusion_[k * size_ + k];
    const std::int64_t in_union = in_truth + in_prediction - both;
    if (in_union == 0) continue;
    iou += static_cast<double>(both) / static_cast<double>(in_union);
    ++occurring;
  }
  scores.iou =
      occurring == 0 ? Measured::Undefined("no pixel has a class") : Measured::Of(iou / occurring);
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
