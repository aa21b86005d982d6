#include "mapper/network/yolo_masks.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <span>

namespace tsdfpp {
namespace {

constexpr double kLeastScore = 0.5;

// A row of the boxes' table.
struct YoloBox {
  cv::Rect2d box;  // in the input
  std::size_t semantic_class = 0;
  float score = 0;
  std::vector<float> weights;
};

// How the boxes' table is read.
struct YoloLayout {
  int boxes = 0;
  int before_scores = 4;  // 5 with a score of its own for "is there something"
  bool box_is_column = true;

  float At(const NetworkOutput& table, int box, int field, int fields) const {
    const std::size_t place =
        box_is_column ? static_cast<std::size_t>(field) * static_cast<std::size_t>(boxes) +
                            static_cast<std::size_t>(box)
                      : static_cast<std::size_t>(box) * static_cast<std::size_t>(fields) +
                            static_cast<std::size_t>(field);
    return table.values[place];
  }
};

std::optional<YoloLayout> LayoutOf(const NetworkOutput& table, int classes, int weights) {
  if (table.sides.size() != 3 || table.sides[0] != 1) return std::nullopt;
  const int rows = table.sides[1];
  const int columns = table.sides[2];
  if (rows == 4 + classes + weights) return YoloLayout{columns, 4, true};
  if (columns == 5 + classes + weights) return YoloLayout{rows, 5, false};
  return std::nullopt;
}

std::vector<YoloBox> FindBoxes(const NetworkOutput& table, const YoloLayout& layout, int classes,
                               int weights, double least_score) {
  const int fields = layout.before_scores + classes + weights;
  std::vector<YoloBox> found;
  for (int i = 0; i < layout.boxes; ++i) {
    const auto at = [&](int field) { return layout.At(table, i, field, fields); };
    const float is_there = layout.before_scores == 5 ? at(4) : 1;
    YoloBox box;
    for (int c = 0; c < classes; ++c) {
      const float score = is_there * at(layout.before_scores + c);
      if (!(score > box.score)) continue;
      box.score = score;
      box.semantic_class = static_cast<std::size_t>(c);
    }
    const bool is_box = std::isfinite(at(0)) && std::isfinite(at(1)) && at(2) > 0 && at(3) > 0 &&
                        std::isfinite(at(2)) && std::isfinite(at(3));
    if (!(box.score >= least_score) || !is_box) continue;
    box.box = {at(0) - at(2) / 2.0, at(1) - at(3) / 2.0, at(2), at(3)};
    for (int w = 0; w < weights; ++w) {
      box.weights.push_back(at(layout.before_scores + classes + w));
    }
    found.push_back(std::move(box));
  }
  return found;
}

// The surest first; of two of a class that overlap the surer one.
std::vector<YoloBox> WithoutRepeats(std::vector<YoloBox> boxes, double most_overlap) {
  std::stable_sort(boxes.begin(), boxes.end(),
                   [](const YoloBox& a, const YoloBox& b) { return a.score > b.score; });
  std::vector<YoloBox> kept;
  for (YoloBox& box : boxes) {
    if (kept.size() == kMostInstances) break;
    const bool is_repeat = std::any_of(kept.begin(), kept.end(), [&](const YoloBox& other) {
      if (other.semantic_class != box.semantic_class) return false;
      const double both = (other.box & box.box).area();
      return both > most_overlap * (other.box.area() + box.box.area() - both);
    });
    if (!is_repeat) kept.push_back(std::move(box));
  }
  return kept;
}

// Where the logits of a box's mask are read: between the prototypes' pixels.
float LinearAt(const cv::Mat& logits, double x, double y) {
  x = std::clamp(x, 0.0, static_cast<double>(logits.cols - 1));
  y = std::clamp(y, 0.0, static_cast<double>(logits.rows - 1));
  const int u = std::min(static_cast<int>(x), std::max(0, logits.cols - 2));
  const int v = std::min(static_cast<int>(y), std::max(0, logits.rows - 2));
  const int right = std::min(u + 1, logits.cols - 1);
  const int below = std::min(v + 1, logits.rows - 1);
  const double a = x - u;
  const double b = y - v;
  const auto at = [&](int row, int column) {
    return static_cast<double>(logits.at<float>(row, column));
  };
  return static_cast<float>((1 - b) * ((1 - a) * at(v, u) + a * at(v, right)) +
                            b * ((1 - a) * at(below, u) + a * at(below, right)));
}

cv::Mat LogitsOf(std::span<const float> weights, const NetworkOutput& prototypes) {
  const int height = prototypes.sides[2];
  const int width = prototypes.sides[3];
  cv::Mat logits(height, width, CV_32FC1, cv::Scalar(0));
  const auto plane = static_cast<std::size_t>(height) * static_cast<std::size_t>(width);
  auto* sum = logits.ptr<float>();
  for (std::size_t m = 0; m < weights.size(); ++m) {
    const float* prototype = prototypes.values + m * plane;
    for (std::size_t i = 0; i < plane; ++i) sum[i] += weights[m] * prototype[i];
  }
  return logits;
}

// Pixels whose middles lie within a box of the input, of the image.
cv::Rect PixelsOf(const cv::Rect2d& box, const Letterbox& letterbox, cv::Size image) {
  const auto first = [](double edge, int offset, double scale) {
    return std::ceil((edge - offset) / scale - 0.5);
  };
  const auto clamped = [](double edge, int most) {
    return static_cast<int>(std::clamp(edge, 0.0, static_cast<double>(most)));
  };
  const cv::Point at = letterbox.place.tl();
  const double across = letterbox.scale_x();
  const double down = letterbox.scale_y();
  const int left = clamped(first(box.x, at.x, across), image.width);
  const int top = clamped(first(box.y, at.y, down), image.height);
  const int right = clamped(first(box.x + box.width, at.x, across), image.width);
  const int bottom = clamped(first(box.y + box.height, at.y, down), image.height);
  return {left, top, right - left, bottom - top};
}

}  // namespace

Letterbox LetterboxOf(cv::Size image, cv::Size input) {
  const double scale = std::min(static_cast<double>(input.width) / image.width,
                                static_cast<double>(input.height) / image.height);
  const auto rounded = [](double at) { return static_cast<int>(std::lround(at)); };
  const cv::Rect place(rounded((input.width - scale * image.width) / 2),
                       rounded((input.height - scale * image.height) / 2),
                       std::max(1, rounded(scale * image.width)),
                       std::max(1, rounded(scale * image.height)));
  return {place & cv::Rect(cv::Point(), input), image, input};
}

Expected<std::vector<Instance>> InstancesOfYolo(const NetworkOutput& boxes,
                                                const NetworkOutput& prototypes,
                                                const Letterbox& letterbox, cv::Size image,
                                                const std::vector<std::string>& classes,
                                                const NetworkConfig& config) {
  if (prototypes.sides.size() != 4 || prototypes.sides[0] != 1) {
    return DataError("its prototypes are {}, expected 1xMxHxW", prototypes.Shape());
  }
  const int weights = prototypes.sides[1];
  const auto layout = LayoutOf(boxes, static_cast<int>(classes.size()), weights);
  if (!layout) {
    return DataError(
        "its boxes are {}, expected 1x{}xN or 1xNx{} with {} classes and {} prototypes",
        boxes.Shape(), 4 + classes.size() + static_cast<std::size_t>(weights),
        5 + classes.size() + static_cast<std::size_t>(weights), classes.size(), weights);
  }
  const double least_score = config.least_score > 0 ? config.least_score : kLeastScore;
  const std::vector<YoloBox> found = WithoutRepeats(
      FindBoxes(boxes, *layout, static_cast<int>(classes.size()), weights, least_score),
      config.most_overlap);
  // The logistic function is above mask_share where its argument is above this.
  const double least_logit = std::log(config.mask_share / (1 - config.mask_share));
  const double across = static_cast<double>(prototypes.sides[3]) / letterbox.input.width;
  const double down = static_cast<double>(prototypes.sides[2]) / letterbox.input.height;
  std::vector<Instance> instances;
  for (const YoloBox& box : found) {
    const cv::Rect pixels = PixelsOf(box.box, letterbox, image);
    if (pixels.empty()) continue;
    const cv::Mat logits = LogitsOf(box.weights, prototypes);
    cv::Mat mask(pixels.size(), CV_8UC1);
    for (int v = 0; v < mask.rows; ++v) {
      const double y = (pixels.y + v + 0.5) * letterbox.scale_y() + letterbox.place.y;
      for (int u = 0; u < mask.cols; ++u) {
        const double x = (pixels.x + u + 0.5) * letterbox.scale_x() + letterbox.place.x;
        const float logit = LinearAt(logits, x * across - 0.5, y * down - 0.5);
        mask.at<std::uint8_t>(v, u) = logit > least_logit ? 255 : 0;
      }
    }
    if (cv::countNonZero(mask) == 0) continue;
    instances.push_back({pixels, mask, classes[box.semantic_class], box.score});
  }
  return instances;
}

}  // namespace tsdfpp
