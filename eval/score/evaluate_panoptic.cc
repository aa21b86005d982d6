#include "eval/score/evaluate_panoptic.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <iterator>

#include "core/data_folder.h"
#include "eval/score/coco_panoptic.h"
#include "eval/score/label_image.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;

// The names of a folder's images, sorted.
Expected<std::vector<std::string>> ImagesIn(const fs::path& folder) {
  std::error_code failure;
  std::vector<std::string> names;
  for (fs::directory_iterator entry(folder, failure), end; !failure && entry != end;
       entry.increment(failure)) {
    std::string extension = entry->path().extension().string();
    std::ranges::transform(extension, extension.begin(),
                           [](unsigned char c) { return std::tolower(c); });
    if (extension == ".png") names.push_back(entry->path().filename().string());
  }
  if (failure) return DataError("{}: cannot be read as a folder", folder.string());
  std::sort(names.begin(), names.end());
  if (names.empty()) return DataError("{}: holds no .png image", folder.string());
  return names;
}

// The names of the true images, each of which has a prediction.
Expected<std::vector<std::string>> PairedImages(const fs::path& truth, const fs::path& prediction,
                                                std::vector<std::string>* remarks) {
  TSDFPP_ASSIGN(std::vector<std::string> names, ImagesIn(truth));
  TSDFPP_ASSIGN(const std::vector<std::string> predicted, ImagesIn(prediction));
  std::vector<std::string> missing;
  std::set_difference(names.begin(), names.end(), predicted.begin(), predicted.end(),
                      std::back_inserter(missing));
  if (!missing.empty()) {
    return DataError("{}: lacks {} of the {} images of {}, the first {}", prediction.string(),
                     missing.size(), names.size(), truth.string(), missing.front());
  }
  if (predicted.size() > names.size()) {
    remarks->push_back(fmt::format("{}: {} of its images are not in {} and are left out",
                                   prediction.string(), predicted.size() - names.size(),
                                   truth.string()));
  }
  return names;
}

// Of objects each id is a class, and 0, the background, is one too.
Expected<PanopticCounts> CountLabelled(const cv::Mat& truth, const cv::Mat& prediction,
                                       const LabelEncoding& encoding) {
  const int shift = encoding.objects ? 1 : 0;
  const int divisor = encoding.objects ? 1 : encoding.divisor;
  TSDFPP_ASSIGN(const PanopticCounts shifted,
                CountPanoptic(SegmentsOfLabels(truth + shift, divisor),
                              SegmentsOfLabels(prediction + shift, divisor)));
  PanopticCounts counts;
  for (const auto& [class_id, of_class] : shifted) counts[class_id - shift] = of_class;
  return counts;
}

// The class of each pixel; of objects their ids.
cv::Mat Classes(const cv::Mat& numbers, const LabelEncoding& encoding) {
  cv::Mat classes = numbers.clone();
  if (encoding.objects) return classes;
  for (auto value = classes.begin<std::int32_t>(); value != classes.end<std::int32_t>(); ++value) {
    *value /= encoding.divisor;
  }
  return classes;
}

// (class << kLabelInstanceBits) + instance, for STQ.
cv::Mat TubeLabels(const cv::Mat& numbers, const LabelEncoding& encoding) {
  cv::Mat labels(numbers.size(), CV_32SC1);
  for (int y = 0; y < numbers.rows; ++y) {
    for (int x = 0; x < numbers.cols; ++x) {
      const std::int32_t value = numbers.at<std::int32_t>(y, x);
      std::int32_t label = 0;
      if (encoding.objects) {
        if (value != 0) label = (1 << kLabelInstanceBits) + value;
      } else {
        // A class beyond all is refused by its number.
        label = (std::min(value / encoding.divisor, kMostLabelClasses) << kLabelInstanceBits) +
                value % encoding.divisor;
      }
      labels.at<std::int32_t>(y, x) = label;
    }
  }
  return labels;
}

std::optional<TrackingQuality> TrackingOf(const LabelEncoding& encoding) {
  if (encoding.objects) return TrackingQuality(TrackingConfig{2, {1}, -1, kLabelInstanceBits});
  if (encoding.things.empty()) return std::nullopt;
  return TrackingQuality(TrackingConfig{kMostLabelClasses, encoding.things, 0, kLabelInstanceBits});
}

}  // namespace

Expected<PanopticEvaluation> EvaluateCoco(const CocoFolder& truth, const CocoFolder& prediction,
                                          std::vector<std::string>* remarks) {
  TSDFPP_ASSIGN(const CocoAnnotations true_notes, ReadCocoAnnotations(truth.json));
  TSDFPP_ASSIGN(const CocoAnnotations predicted_notes, ReadCocoAnnotations(prediction.json));
  PanopticEvaluation evaluation;
  evaluation.is_thing = true_notes.is_thing;
  const DataFolder truth_folder(truth.images);
  const DataFolder predicted_folder(prediction.images);
  for (const auto& [file, segments] : true_notes.by_file) {
    const std::string& id = true_notes.id_of_file.at(file);
    const auto partner = predicted_notes.file_of_id.find(id);
    if (partner == predicted_notes.file_of_id.end()) {
      return DataError("{}: has no prediction for image {}", prediction.json.string(), id);
    }
    std::array<PanopticImage, 2> images;
    TSDFPP_ASSIGN(const fs::path true_image, truth_folder.Find(file));
    TSDFPP_ASSIGN(images[0].ids, ReadNumbers(true_image, true));
    images[0].segments = segments;
    TSDFPP_ASSIGN(const fs::path predicted_image, predicted_folder.Find(partner->second));
    TSDFPP_ASSIGN(images[1].ids, ReadNumbers(predicted_image, true));
    images[1].segments = predicted_notes.by_file.at(partner->second);
    for (const PanopticImage& image : images) {
      for (const PanopticSegment& segment : image.segments) {
        if (!true_notes.is_thing.empty() && !true_notes.is_thing.contains(segment.class_id)) {
          return DataError("image {}: segment {} has the unknown category {}", id, segment.id,
                           segment.class_id);
        }
      }
    }
    const auto counts = CountPanoptic(images[0], images[1]);
    if (!counts) return DataError("image {}: {}", id, counts.error().message);
    Add(*counts, evaluation.counts);
    ++evaluation.images;
  }
  if (predicted_notes.by_file.size() > true_notes.by_file.size()) {
    remarks->push_back(fmt::format(
        "{}: {} of its images are not in {} and are left out", prediction.json.string(),
        predicted_notes.by_file.size() - true_notes.by_file.size(), truth.json.string()));
  }
  return evaluation;
}

Expected<PanopticEvaluation> EvaluateLabels(const fs::path& truth, const fs::path& prediction,
                                            const LabelEncoding& encoding,
                                            std::vector<std::string>* remarks) {
  TSDFPP_ASSIGN(const std::vector<std::string> names, PairedImages(truth, prediction, remarks));
  PanopticEvaluation evaluation;
  for (const int id : encoding.things) evaluation.is_thing[id] = true;
  evaluation.overlap.emplace();
  evaluation.tracking = TrackingOf(encoding);
  for (const std::string& name : names) {
    TSDFPP_ASSIGN(const cv::Mat ours, ReadNumbers(truth / name, false));
    TSDFPP_ASSIGN(const cv::Mat theirs, ReadNumbers(prediction / name, false));
    const auto counts = CountLabelled(ours, theirs, encoding);
    if (!counts) return DataError("{}: {}", name, counts.error().message);
    Add(*counts, evaluation.counts);
    evaluation.overlap->Observe(Classes(ours, encoding), Classes(theirs, encoding),
                                encoding.objects ? -1 : 0);
    if (evaluation.tracking) {
      const auto seen =
          evaluation.tracking->Observe(TubeLabels(ours, encoding), TubeLabels(theirs, encoding));
      if (!seen) return DataError("{}: {}", name, seen.error().message);
    }
    ++evaluation.images;
  }
  return evaluation;
}

}  // namespace tsdfpp
