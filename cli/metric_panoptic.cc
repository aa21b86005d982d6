#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <cstdlib>

#include "cli/metric.h"
#include "eval/score/evaluate_panoptic.h"
#include "eval/score/evaluation.h"

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

// The classes of --things.
Expected<std::set<int>> ThingsOf(const MetricPanopticArguments& options) {
  std::set<int> things;
  for (const std::string& word : SplitList(options.things)) {
    const int id = std::atoi(word.c_str());
    if (std::to_string(id) != word || id <= 0 || id >= kMostLabelClasses) {
      return UsageError("--things '{}': expected classes from 1 to {} between commas",
                        options.things, kMostLabelClasses - 1);
    }
    things.insert(id);
  }
  return things;
}

// A folder of COCO's with the JSON that was named, or panopticapi's own default.
CocoFolder CocoFolderOf(const std::string& folder, const std::string& json) {
  if (!json.empty()) return {folder, json};
  const fs::path path = fs::path(folder) / "";
  return {folder, path.parent_path().string() + ".json"};
}

Expected<PanopticEvaluation> EvaluateFolders(const MetricPanopticArguments& options,
                                             std::vector<std::string>& remarks) {
  TSDFPP_ASSIGN(const std::set<int> things, ThingsOf(options));
  if (options.encoding == "coco") {
    if (!things.empty()) {
      return UsageError("--things does not go with --encoding coco, whose JSON names them");
    }
    auto evaluation =
        EvaluateCoco(CocoFolderOf(options.truth, options.truth_json),
                     CocoFolderOf(options.prediction, options.prediction_json), &remarks);
    for (const std::string& remark : remarks) spdlog::warn("{}", remark);
    return evaluation;
  }
  if (!options.truth_json.empty() || !options.prediction_json.empty()) {
    return UsageError("--gt-json and --pred-json go with --encoding coco only");
  }
  const bool objects = options.encoding == "objects";
  if (objects && !things.empty()) {
    return UsageError("--things goes with --encoding class-instance only");
  }
  auto evaluation = EvaluateLabels(options.truth, options.prediction,
                                   {objects, options.divisor, things}, &remarks);
  for (const std::string& remark : remarks) spdlog::warn("{}", remark);
  return evaluation;
}

nlohmann::json ToJson(const PanopticQuality& quality) {
  return {{"pq", tsdfpp::ToJson(quality.pq)},
          {"sq", tsdfpp::ToJson(quality.sq)},
          {"rq", tsdfpp::ToJson(quality.rq)}};
}

// What the command says, filled line by line.
struct PanopticLines {
  nlohmann::json json;
  std::string text;

  void AddMean(const char* title, const MeanPanopticQuality& quality) {
    json[title] = ToJson(quality.mean);
    json[title]["classes"] = quality.classes;
    text += quality.mean.pq.value
                ? fmt::format("{:<10} {:>8.4f} {:>8.4f} {:>8.4f} {:>6}\n", title,
                              *quality.mean.pq.value, *quality.mean.sq.value,
                              *quality.mean.rq.value, quality.classes)
                : fmt::format("{:<10} undefined: {}\n", title, quality.mean.pq.why_not);
  }

  // Over all classes, and over things and stuff where it is known which are which.
  void AddMeans(const PanopticEvaluation& evaluation) {
    AddMean("all", MeanQuality(evaluation.counts));
    if (evaluation.is_thing.empty()) return;
    std::set<int> stuff;
    std::set<int> things;
    for (const auto& [class_id, counts] : evaluation.counts) {
      const auto known = evaluation.is_thing.find(class_id);
      (known != evaluation.is_thing.end() && known->second ? things : stuff).insert(class_id);
    }
    AddMean("things", MeanQuality(evaluation.counts, things));
    AddMean("stuff", MeanQuality(evaluation.counts, stuff));
  }

  void AddClass(int class_id, const ClassCounts& counts) {
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

  void AddOverlap(const LabelOverlap& overlap) {
    for (const auto& [label, iou] : overlap.ByLabel()) {
      json["iou"]["by_label"][std::to_string(label)] = iou;
    }
    json["iou"]["per_frame_mean"] = tsdfpp::ToJson(overlap.PerFrameMean());
    text +=
        fmt::format("IoU of labels, mean over the images: {}\n", ShareText(overlap.PerFrameMean()));
  }

  void AddTracking(const TrackingQuality::Scores& scores) {
    json["stq"] = {{"stq", tsdfpp::ToJson(scores.stq)},
                   {"aq", tsdfpp::ToJson(scores.aq)},
                   {"iou", tsdfpp::ToJson(scores.iou)}};
    text += fmt::format("STQ {}, association AQ {}, IoU {}\n", ShareText(scores.stq),
                        ShareText(scores.aq), ShareText(scores.iou));
  }
};

Expected<CommandResult> RunPanoptic(const MetricPanopticArguments& options) {
  std::vector<std::string> remarks;
  TSDFPP_ASSIGN(const PanopticEvaluation evaluation, EvaluateFolders(options, remarks));
  PanopticLines lines;
  lines.json = {{"truth", options.truth},
                {"prediction", options.prediction},
                {"encoding", options.encoding},
                {"images", evaluation.images},
                {"remarks", remarks}};
  lines.text = fmt::format("{} images\n{:<10} {:>8} {:>8} {:>8} {:>6}\n", evaluation.images, "",
                           "PQ", "SQ", "RQ", "N");
  lines.AddMeans(evaluation);
  for (const auto& [class_id, counts] : evaluation.counts) lines.AddClass(class_id, counts);
  if (evaluation.overlap) lines.AddOverlap(*evaluation.overlap);
  if (evaluation.tracking) lines.AddTracking(evaluation.tracking->Result());
  return CommandResult{lines.json, lines.text};
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
      ->check(WholeBetween(1, 1 << kLabelInstanceBits))
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
