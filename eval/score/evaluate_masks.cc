#include "eval/score/evaluate_masks.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <optional>

#include "core/data_folder.h"
#include "core/one_line.h"
#include "eval/score/evaluation.h"
#include "eval/score/label_image.h"
#include "sequence/integer_images.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;

// The number that a name ends with: 12 of "Mask0012.png".
std::optional<int> NumberAtEnd(const std::string& stem) {
  std::size_t begin = stem.size();
  while (begin > 0 && std::isdigit(static_cast<unsigned char>(stem[begin - 1])) != 0) --begin;
  int number = 0;
  const auto [end, status] =
      std::from_chars(stem.data() + begin, stem.data() + stem.size(), number);
  if (begin == stem.size() || status != std::errc()) return std::nullopt;
  return number;
}

// Every label a segment of one class; 0, the background, is a segment too.
PanopticImage AsSegments(const cv::Mat& labels) {
  PanopticImage image = SegmentsOfLabels(labels + 1, 1);
  for (PanopticSegment& segment : image.segments) segment.class_id = 1;
  return image;
}

}  // namespace

Expected<MaskEvaluator> MaskEvaluator::Open(const fs::path& folder) {
  std::error_code failure;
  if (!fs::is_directory(folder, failure)) {
    return UsageError("--masks {}: no such folder", folder.string());
  }
  TSDFPP_RETURN_IF_ERROR(CheckLinksBelow(folder));
  MaskEvaluator evaluator;
  evaluator.folder_ = folder;
  for (fs::directory_iterator entry(folder, failure), end; !failure && entry != end;
       entry.increment(failure)) {
    const IdEnding ending = IdEndingOf(entry->path());
    if (ending == IdEnding::kOther) {
      evaluator.not_ids_.push_back(entry->path().filename().string());
    }
    if (ending != IdEnding::kIds) continue;
    const auto frame = NumberAtEnd(entry->path().stem().string());
    if (!frame) {
      evaluator.unnumbered_.push_back(entry->path().filename().string());
      continue;
    }
    const auto [at, is_new] = evaluator.images_.emplace(*frame, entry->path());
    if (!is_new) {
      return DataError("{}: is of frame {}, as is {}", entry->path().string(), *frame,
                       at->second.filename().string());
    }
  }
  if (failure) return DataError("{}: cannot be read as a folder", folder.string());
  if (evaluator.images_.empty()) {
    return DataError("{}: holds no image named after a frame, expected e.g. Mask0001.png",
                     folder.string());
  }
  std::ranges::sort(evaluator.unnumbered_);
  std::ranges::sort(evaluator.not_ids_);
  return evaluator;
}

Expected<void> MaskEvaluator::Observe(const Frame& frame) {
  const auto image = images_.find(frame.index);
  if (image == images_.end()) return {};
  TSDFPP_ASSIGN(const cv::Mat labels, ReadNumbers(image->second, false));
  if (labels.size() != frame.mask.size()) {
    return DataError("{}: is {} x {}, expected {} x {}", image->second.string(), labels.cols,
                     labels.rows, frame.mask.cols, frame.mask.rows);
  }
  cv::Mat truth;
  frame.mask.convertTo(truth, CV_32SC1);
  for (const auto& [pair, pixels] : CountLabelPairs(truth, labels)) pairs_[pair] += pixels;
  TSDFPP_ASSIGN(const PanopticCounts counts, CountPanoptic(AsSegments(truth), AsSegments(labels)));
  Add(counts, counts_);
  ++observed_;
  return {};
}

Expected<MaskEvaluation> MaskEvaluator::Result(const SequenceInfo& info,
                                               const std::vector<ObjectInfo>& objects,
                                               MatchMode mode) const {
  if (observed_ == 0) {
    return DataError("{}: none of its images is of a frame that was evaluated", folder_.string());
  }
  MaskEvaluation out;
  out.images = observed_;
  const int last = info.first_index + info.frame_count - 1;
  const auto strangers = std::count_if(images_.begin(), images_.end(), [&](const auto& image) {
    return image.first < info.first_index || image.first > last;
  });
  if (strangers > 0) {
    out.remarks.push_back(
        fmt::format("{}: {} images are of no frame of the sequence, which has {} to {}: left out",
                    folder_.string(), strangers, info.first_index, last));
  }
  if (!unnumbered_.empty()) {
    out.remarks.push_back(
        fmt::format("{}: {} images, {} among them, end in no frame's number: left out",
                    folder_.string(), unnumbered_.size(), Quoted(unnumbered_.front())));
  }
  if (!not_ids_.empty()) {
    out.remarks.push_back(
        fmt::format("{}: {} images, {} among them, do not hold ids exactly: left "
                    "out, expected e.g. .png",
                    folder_.string(), not_ids_.size(), Quoted(not_ids_.front())));
  }
  std::map<int, std::pair<std::int64_t, InstanceId>> most;  // of each predicted id
  for (const auto& [pair, pixels] : pairs_) {
    auto& [best, object] = most.try_emplace(pair.second, 0, kNoInstance).first->second;
    if (pixels > best) {
      best = pixels;
      object = static_cast<InstanceId>(pair.first);
    }
  }
  for (const auto& [label, best] : most) {
    const bool known = std::any_of(objects.begin(), objects.end(), [&, id = label](const auto& o) {
      return static_cast<int>(o.id) == id;
    });
    const bool given = label == kBackground || (mode == MatchMode::kNames && known);
    out.object_of[label] = given ? static_cast<InstanceId>(label) : best.second;
  }
  std::map<InstanceId, std::int64_t> shared;
  std::map<InstanceId, std::int64_t> united;
  std::set<InstanceId> in_truth;
  for (const auto& [pair, pixels] : pairs_) {
    const auto truth = static_cast<InstanceId>(pair.first);
    const InstanceId predicted = out.object_of.at(pair.second);
    in_truth.insert(truth);
    united[truth] += pixels;
    if (truth == predicted) {
      shared[truth] += pixels;
    } else {
      united[predicted] += pixels;
    }
  }
  double sum = 0;
  for (const InstanceId id : in_truth) {
    const double iou = static_cast<double>(shared[id]) / static_cast<double>(united[id]);
    out.iou[id] = Measured::Of(iou);
    sum += iou;
  }
  out.mean_iou = Measured::Of(sum / static_cast<double>(in_truth.size()));
  out.quality = QualityOf(counts_.at(1));
  return out;
}

nlohmann::json ToJson(const MaskEvaluation& evaluation) {
  nlohmann::json json{{"images", evaluation.images},
                      {"remarks", evaluation.remarks},
                      {"mean_iou", ToJson(evaluation.mean_iou)},
                      {"pq", ToJson(evaluation.quality.pq)},
                      {"sq", ToJson(evaluation.quality.sq)},
                      {"rq", ToJson(evaluation.quality.rq)}};
  for (const auto& [id, iou] : evaluation.iou) json["iou"][std::to_string(id)] = ToJson(iou);
  for (const auto& [label, object] : evaluation.object_of) {
    json["object_of"][std::to_string(label)] = object;
  }
  return json;
}

}  // namespace tsdfpp
