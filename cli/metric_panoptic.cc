#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <limits>
#include <optional>
#include <stdexcept>

#include "cli/metric.h"
#include "core/data_folder.h"
#include "core/json_text.h"
#include "core/one_line.h"
#include "eval/score/evaluation.h"
#include "eval/score/label_image.h"
#include "metrics/segmentation.h"
#include "metrics/tracking_quality.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;

struct MetricPanopticArguments {
  std::string truth;
  std::string prediction;
  std::string encoding = "class-instance";
  std::string truth_json;
  std::string prediction_json;
  std::string things;
  int divisor = 1000;
};

constexpr int kInstanceBits = 16;
constexpr int kMostClasses = 1 << 14;

Expected<std::vector<std::string>> ImagesIn(const fs::path& folder) {
  std::error_code failure;
  std::vector<std::string> names;
  for (fs::directory_iterator entry(folder, failure), end; !failure && entry != end;
       entry.increment(failure)) {
    if (entry->path().extension() == ".png") names.push_back(entry->path().filename().string());
  }
  if (failure) return DataError("{}: cannot be read as a folder", folder.string());
  std::sort(names.begin(), names.end());
  if (names.empty()) return DataError("{}: holds no .png image", folder.string());
  return names;
}

// COCO's panoptic annotations: what each image's segments are.
struct Annotations {
  std::map<std::string, std::vector<PanopticSegment>> by_file;  // image file name
  std::map<std::string, std::string> id_of_file;
  std::map<std::string, std::string> file_of_id;
  std::map<int, bool> is_thing;  // by category
};

// Throws where it is none: nlohmann's own conversion wraps what does not fit.
int IdOf(const nlohmann::json& json) {
  const auto id = WholeIn(json, 0, std::numeric_limits<int>::max());
  if (!id) throw std::out_of_range(fmt::format("{} is no id", JsonShown(json)));
  return static_cast<int>(*id);
}

// 0 or 1, also as false or true. Throws where it is neither number nor one of these.
bool IsFlagged(const nlohmann::json& object, const char* key, int otherwise) {
  const nlohmann::json flag = object.value(key, nlohmann::json(otherwise));
  if (flag.is_boolean()) return flag.get<bool>();
  const int number = IdOf(flag);
  if (number > 1) {
    throw std::out_of_range(fmt::format("'{}' is {}, expected 0 or 1", key, JsonShown(flag)));
  }
  return number == 1;
}

Expected<Annotations> ReadAnnotations(const fs::path& path) {
  TSDFPP_ASSIGN(const nlohmann::json json, ReadJsonObject(path));
  Annotations out;
  try {
    for (const auto& category : json.value("categories", nlohmann::json::array())) {
      out.is_thing[IdOf(category.at("id"))] = IsFlagged(category, "isthing", 1);
    }
    for (const auto& annotation : json.at("annotations")) {
      const std::string file = annotation.at("file_name");
      const std::string id = JsonText(annotation.at("image_id"));
      if (out.by_file.contains(file) || out.file_of_id.contains(id)) {
        throw std::out_of_range(
            fmt::format("image {} or file {} is there twice", id, Quoted(file)));
      }
      std::vector<PanopticSegment>& segments = out.by_file[file];
      out.id_of_file[file] = id;
      out.file_of_id[id] = file;
      for (const auto& info : annotation.at("segments_info")) {
        segments.push_back(
            {IdOf(info.at("id")), IdOf(info.at("category_id")), IsFlagged(info, "iscrowd", 0)});
      }
    }
  } catch (const std::exception& error) {
    return DataError("{}: is no panoptic JSON as COCO's: {}", path.string(),
                     WithoutTag(error.what()));
  }
  if (out.by_file.empty()) return DataError("{}: has no annotations", path.string());
  return out;
}

// The whole comparison, filled image by image.
struct Totals {
  PanopticCounts counts;
  LabelOverlap overlap;
  std::optional<TrackingQuality> tracking;
  int images = 0;
};

Expected<void> AddCoco(const MetricPanopticArguments& options, const Annotations& truth,
                       const Annotations& prediction, Totals& totals) {
  const DataFolder truth_folder(options.truth);
  const DataFolder predicted_folder(options.prediction);
  for (const auto& [file, segments] : truth.by_file) {
    const std::string& id = truth.id_of_file.at(file);
    const auto partner = prediction.file_of_id.find(id);
    if (partner == prediction.file_of_id.end()) {
      return DataError("{}: has no prediction for image {}", options.prediction_json, id);
    }
    PanopticImage images[2];
    TSDFPP_ASSIGN(const fs::path true_image, truth_folder.Find(file));
    TSDFPP_ASSIGN(images[0].ids, ReadNumbers(true_image, true));
    images[0].segments = segments;
    TSDFPP_ASSIGN(const fs::path predicted_image, predicted_folder.Find(partner->second));
    TSDFPP_ASSIGN(images[1].ids, ReadNumbers(predicted_image, true));
    images[1].segments = prediction.by_file.at(partner->second);
    for (const PanopticImage& image : images) {
      for (const PanopticSegment& segment : image.segments) {
        if (!truth.is_thing.empty() && !truth.is_thing.contains(segment.class_id)) {
          return DataError("image {}: segment {} has the unknown category {}", id, segment.id,
                           segment.class_id);
        }
      }
    }
    const auto counts = CountPanoptic(images[0], images[1]);
    if (!counts) return DataError("image {}: {}", id, counts.error().message);
    Add(*counts, totals.counts);
    ++totals.images;
  }
  return {};
}

// (class << 16) + instance, for STQ.
cv::Mat TubeLabels(const cv::Mat& numbers, const MetricPanopticArguments& options) {
  cv::Mat labels(numbers.size(), CV_32SC1);
  for (int y = 0; y < numbers.rows; ++y) {
    for (int x = 0; x < numbers.cols; ++x) {
      const std::int32_t value = numbers.at<std::int32_t>(y, x);
      std::int32_t label = 0;
      if (options.encoding == "objects") {
        if (value != 0) label = (1 << kInstanceBits) + value;
      } else {
        // A class beyond all is refused by its number.
        label = (std::min(value / options.divisor, kMostClasses) << kInstanceBits) +
                value % options.divisor;
      }
      labels.at<std::int32_t>(y, x) = label;
    }
  }
  return labels;
}

Expected<void> AddLabelled(const MetricPanopticArguments& options, Totals& totals) {
  TSDFPP_ASSIGN(const std::vector<std::string> names, ImagesIn(options.truth));
  TSDFPP_ASSIGN(const std::vector<std::string> predicted, ImagesIn(options.prediction));
  std::vector<std::string> missing;
  std::set_difference(names.begin(), names.end(), predicted.begin(), predicted.end(),
                      std::back_inserter(missing));
  if (!missing.empty()) {
    return DataError("{}: lacks {} of the {} images of {}, the first {}", options.prediction,
                     missing.size(), names.size(), options.truth, missing.front());
  }
  if (predicted.size() > names.size()) {
    spdlog::warn("{}: {} of its images are not in {} and are left out", options.prediction,
                 predicted.size() - names.size(), options.truth);
  }
  const bool objects = options.encoding == "objects";
  for (const std::string& name : names) {
    TSDFPP_ASSIGN(const cv::Mat truth, ReadNumbers(fs::path(options.truth) / name, false));
    TSDFPP_ASSIGN(const cv::Mat prediction,
                  ReadNumbers(fs::path(options.prediction) / name, false));
    // Of objects each id is a class, and 0, the background, is one too.
    const int shift = objects ? 1 : 0;
    const int divisor = objects ? 1 : options.divisor;
    const auto counts = CountPanoptic(SegmentsOfLabels(truth + shift, divisor),
                                      SegmentsOfLabels(prediction + shift, divisor));
    if (!counts) return DataError("{}: {}", name, counts.error().message);
    for (const auto& [class_id, of_class] : *counts) {
      Add({{class_id - shift, of_class}}, totals.counts);
    }
    cv::Mat classes[2] = {truth.clone(), prediction.clone()};
    if (!objects) {
      for (cv::Mat& image : classes) {
        for (auto value = image.begin<std::int32_t>(); value != image.end<std::int32_t>();
             ++value) {
          *value /= divisor;
        }
      }
    }
    totals.overlap.Observe(classes[0], classes[1], objects ? -1 : 0);
    if (totals.tracking) {
      const auto seen =
          totals.tracking->Observe(TubeLabels(truth, options), TubeLabels(prediction, options));
      if (!seen) return DataError("{}: {}", name, seen.error().message);
    }
    ++totals.images;
  }
  return {};
}

nlohmann::json ToJson(const PanopticQuality& quality) {
  return {{"pq", tsdfpp::ToJson(quality.pq)},
          {"sq", tsdfpp::ToJson(quality.sq)},
          {"rq", tsdfpp::ToJson(quality.rq)}};
}

void AddMean(const char* title, const MeanPanopticQuality& quality, nlohmann::json& json,
             std::string& text) {
  json[title] = ToJson(quality.mean);
  json[title]["classes"] = quality.classes;
  text +=
      quality.mean.pq.value
          ? fmt::format("{:<10} {:>8.4f} {:>8.4f} {:>8.4f} {:>6}\n", title, *quality.mean.pq.value,
                        *quality.mean.sq.value, *quality.mean.rq.value, quality.classes)
          : fmt::format("{:<10} undefined: {}\n", title, quality.mean.pq.why_not);
}

Expected<CommandResult> RunPanoptic(MetricPanopticArguments options) {
  Totals totals;
  std::map<int, bool> is_thing;
  std::set<int> things;
  for (const std::string& word : SplitList(options.things)) {
    const int id = std::atoi(word.c_str());
    if (std::to_string(id) != word || id <= 0 || id >= kMostClasses) {
      return UsageError("--things '{}': expected classes from 1 to {} between commas",
                        options.things, kMostClasses - 1);
    }
    things.insert(id);
    is_thing[id] = true;
  }
  if (options.encoding == "coco") {
    if (!things.empty()) {
      return UsageError("--things does not go with --encoding coco, whose JSON names them");
    }
    // panopticapi's own default.
    const auto beside = [](const std::string& folder) {
      const fs::path path = fs::path(folder) / "";
      return path.parent_path().string() + ".json";
    };
    if (options.truth_json.empty()) options.truth_json = beside(options.truth);
    if (options.prediction_json.empty()) options.prediction_json = beside(options.prediction);
    TSDFPP_ASSIGN(const Annotations truth, ReadAnnotations(options.truth_json));
    TSDFPP_ASSIGN(const Annotations prediction, ReadAnnotations(options.prediction_json));
    is_thing = truth.is_thing;
    TSDFPP_RETURN_IF_ERROR(AddCoco(options, truth, prediction, totals));
  } else {
    if (!options.truth_json.empty() || !options.prediction_json.empty()) {
      return UsageError("--gt-json and --pred-json go with --encoding coco only");
    }
    if (options.encoding == "objects") {
      if (!things.empty()) return UsageError("--things goes with --encoding class-instance only");
      totals.tracking.emplace(TrackingConfig{2, {1}, -1, kInstanceBits});
    } else if (!things.empty()) {
      totals.tracking.emplace(TrackingConfig{kMostClasses, things, 0, kInstanceBits});
    }
    TSDFPP_RETURN_IF_ERROR(AddLabelled(options, totals));
  }

  nlohmann::json json = {{"truth", options.truth},
                         {"prediction", options.prediction},
                         {"encoding", options.encoding},
                         {"images", totals.images}};
  std::string text = fmt::format("{} images\n{:<10} {:>8} {:>8} {:>8} {:>6}\n", totals.images, "",
                                 "PQ", "SQ", "RQ", "N");
  AddMean("all", MeanQuality(totals.counts), json, text);
  if (!is_thing.empty()) {
    std::set<int> stuff;
    std::set<int> of_things;
    for (const auto& [class_id, counts] : totals.counts) {
      const auto known = is_thing.find(class_id);
      (known != is_thing.end() && known->second ? of_things : stuff).insert(class_id);
    }
    AddMean("things", MeanQuality(totals.counts, of_things), json, text);
    AddMean("stuff", MeanQuality(totals.counts, stuff), json, text);
  }
  for (const auto& [class_id, counts] : totals.counts) {
    const PanopticQuality quality = QualityOf(counts);
    nlohmann::json of_class = ToJson(quality);
    of_class["tp"] = counts.true_positives;
    of_class["fp"] = counts.false_positives;
    of_class["fn"] = counts.false_negatives;
    of_class["iou_sum"] = counts.iou_sum;
    json["per_class"][std::to_string(class_id)] = of_class;
    text += fmt::format(
        "class {:<4} {:>8.4f} {:>8} {:>8.4f}        TP {} FP {} FN {}\n", class_id,
        *quality.pq.value, quality.sq.value ? fmt::format("{:.4f}", *quality.sq.value) : "-",
        *quality.rq.value, counts.true_positives, counts.false_positives, counts.false_negatives);
  }
  if (options.encoding != "coco") {
    for (const auto& [label, iou] : totals.overlap.ByLabel()) {
      json["iou"]["by_label"][std::to_string(label)] = iou;
    }
    json["iou"]["per_frame_mean"] = tsdfpp::ToJson(totals.overlap.PerFrameMean());
    text += fmt::format("IoU of labels, mean over the images: {}\n",
                        ShareText(totals.overlap.PerFrameMean()));
  }
  if (totals.tracking) {
    const TrackingQuality::Scores scores = totals.tracking->Result();
    json["stq"] = {{"stq", tsdfpp::ToJson(scores.stq)},
                   {"aq", tsdfpp::ToJson(scores.aq)},
                   {"iou", tsdfpp::ToJson(scores.iou)}};
    text += fmt::format("STQ {}, association AQ {}, IoU {}\n", ShareText(scores.stq),
                        ShareText(scores.aq), ShareText(scores.iou));
  }
  return CommandResult{json, text};
}

}  // namespace

Run AddMetricPanoptic(CLI::App& app) {
  auto options = std::make_shared<MetricPanopticArguments>();
  app.add_option("GT_DIR", options->truth, "Folder of true images (.png)")->required();
  app.add_option("PRED_DIR", options->prediction, "Folder of predicted images, the same names")
      ->required();
  app.add_option("--encoding", options->encoding,
                 "class-instance: class x divisor + instance, class 0 void; objects: an id an "
                 "object, 0 the background; coco: RGB ids and JSON, as panopticapi")
      ->check(OneOf({"class-instance", "objects", "coco"}))
      ->capture_default_str();
  app.add_option("--divisor", options->divisor, "Of class-instance")
      ->check(WholeBetween(1, 1 << kInstanceBits))
      ->capture_default_str();
  app.add_option("--things", options->things,
                 "Of class-instance: the classes that have instances, by commas; adds their mean "
                 "and STQ, the images being one sequence in order of their names");
  app.add_option("--gt-json", options->truth_json, "Of coco; GT_DIR.json by default");
  app.add_option("--pred-json", options->prediction_json, "Of coco; PRED_DIR.json by default");
  AddFollowLinks(app);
  return [options] { return RunPanoptic(*options); };
}

}  // namespace tsdfpp
