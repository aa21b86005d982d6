#include "eval/score/segment_scores.h"

#include <algorithm>

#include "eval/score/evaluation.h"

namespace tsdfpp {
namespace {

constexpr int kBackgroundClass = 1;
constexpr int kObjectClass = 2;

// Ids as numbers from 1 on, so that kVoid is what is left out.
PanopticImage AsSegments(const cv::Mat& ids, const cv::Mat& depth) {
  cv::Mat numbers(ids.size(), CV_32SC1);
  for (int v = 0; v < ids.rows; ++v) {
    const auto* id = ids.ptr<InstanceId>(v);
    const auto* z = depth.ptr<float>(v);
    auto* number = numbers.ptr<std::int32_t>(v);
    for (int u = 0; u < ids.cols; ++u) {
      const bool counts = IsValidDepth(z[u]) && id[u] != kNoInstance;
      number[u] = counts ? id[u] + 1 : kVoid;
    }
  }
  PanopticImage image = SegmentsOfLabels(numbers, 1);
  for (PanopticSegment& segment : image.segments) {
    segment.class_id = segment.id == kBackground + 1 ? kBackgroundClass : kObjectClass;
  }
  return image;
}

bool AreOfOneKind(std::int32_t a, std::int32_t b) {
  return (a == kBackground + 1) == (b == kBackground + 1);
}

}  // namespace

Expected<void> SegmentScorer::Observe(const cv::Mat& truth, const cv::Mat& ids,
                                      const cv::Mat& depth) {
  if (truth.type() != CV_16UC1 || ids.type() != CV_16UC1 || depth.type() != CV_32FC1 ||
      truth.size() != ids.size() || truth.size() != depth.size()) {
    return DataError("segments of {} x {} pixels are compared with {} x {}, expected equal sizes",
                     ids.cols, ids.rows, truth.cols, truth.rows);
  }
  const PanopticImage true_segments = AsSegments(truth, depth);
  const PanopticImage segments = AsSegments(ids, depth);
  TSDFPP_ASSIGN(const PanopticCounts counts, CountPanoptic(true_segments, segments));
  Add(counts, counts_);
  const LabelPairs pairs = CountLabelPairs(true_segments.ids, segments.ids);
  std::map<std::int32_t, std::int64_t> true_pixels;
  std::map<std::int32_t, std::int64_t> pixels;
  std::map<std::int32_t, std::pair<std::int64_t, std::int32_t>> most;  // of each predicted one
  for (const auto& [pair, both] : pairs) {
    if (pair.first == kVoid) continue;
    true_pixels[pair.first] += both;
    pixels[pair.second] += both;
    auto& [best, object] = most[pair.second];
    if (both > best) {
      best = both;
      object = pair.first;
    }
  }
  std::map<std::int32_t, double> best_iou;
  for (const auto& [pair, both] : pairs) {
    const auto [true_id, id] = pair;
    if (true_id == kVoid) continue;
    const auto object = static_cast<InstanceId>(true_id - 1);
    united_[object] += both;
    best_iou.try_emplace(true_id, 0);
    if (id == kVoid) continue;
    const std::int32_t given = most[id].second;
    if (given == true_id) {
      shared_[object] += both;
    } else {
      united_[static_cast<InstanceId>(given - 1)] += both;
    }
    if (!AreOfOneKind(true_id, id)) continue;
    const double iou =
        static_cast<double>(both) / static_cast<double>(true_pixels[true_id] + pixels[id] - both);
    best_iou[true_id] = std::max(best_iou[true_id], iou);
  }
  if (best_iou.empty()) return {};
  double sum = 0;
  for (const auto& [id, iou] : best_iou) sum += iou;
  iou_sum_ += sum / static_cast<double>(best_iou.size());
  ++frames_;
  return {};
}

SegmentScores SegmentScorer::Result() const {
  SegmentScores scores;
  scores.frames = frames_;
  if (frames_ == 0) {
    const Measured undefined = Measured::Undefined("no frame has a pixel with depth and a mask");
    scores.mean_iou = scores.sequence_iou = undefined;
    scores.quality = scores.background = scores.objects = {undefined, undefined, undefined};
    return scores;
  }
  scores.mean_iou = Measured::Of(iou_sum_ / frames_);
  ClassCounts all;
  const auto of_class = [&](int class_id) {
    const auto found = counts_.find(class_id);
    const ClassCounts counts = found == counts_.end() ? ClassCounts{} : found->second;
    all.true_positives += counts.true_positives;
    all.false_positives += counts.false_positives;
    all.false_negatives += counts.false_negatives;
    all.iou_sum += counts.iou_sum;
    return QualityOf(counts);
  };
  scores.background = of_class(kBackgroundClass);
  scores.objects = of_class(kObjectClass);
  scores.quality = QualityOf(all);
  double sum = 0;
  for (const auto& [object, in_union] : united_) {
    const auto shared = shared_.find(object);
    const double both = shared == shared_.end() ? 0 : static_cast<double>(shared->second);
    scores.iou[object] = both / static_cast<double>(in_union);
    sum += scores.iou[object];
  }
  scores.sequence_iou = Measured::Of(sum / static_cast<double>(scores.iou.size()));
  return scores;
}

nlohmann::json ToJson(const SegmentScores& scores) {
  const auto quality = [](const PanopticQuality& q) {
    return nlohmann::json{{"pq", ToJson(q.pq)}, {"sq", ToJson(q.sq)}, {"rq", ToJson(q.rq)}};
  };
  nlohmann::json json{{"frames", scores.frames},
                      {"mean_iou", ToJson(scores.mean_iou)},
                      {"all", quality(scores.quality)},
                      {"background", quality(scores.background)},
                      {"objects", quality(scores.objects)},
                      {"sequence_iou", ToJson(scores.sequence_iou)}};
  for (const auto& [id, iou] : scores.iou) json["iou"][std::to_string(id)] = iou;
  return json;
}

}  // namespace tsdfpp
