#include "metrics/segmentation.h"

#include <algorithm>

namespace tsdfpp {
namespace {

struct Listed {
  PanopticSegment segment;
  std::int64_t area = 0;
  bool matched = false;
};
using Segments = std::map<std::int32_t, Listed>;

Expected<Segments> ListSegments(const PanopticImage& image,
                                const std::map<std::int32_t, std::int64_t>& areas,
                                const char* whose) {
  Segments segments;
  for (const PanopticSegment& segment : image.segments) {
    if (segment.id == kVoid || !segments.emplace(segment.id, Listed{segment}).second) {
      return DataError("{}: segment id {} is {}", whose, segment.id,
                       segment.id == kVoid ? "the id of void" : "listed twice");
    }
  }
  for (const auto& [id, area] : areas) {
    if (id == kVoid) continue;
    const auto listed = segments.find(id);
    if (listed == segments.end()) {
      return DataError("{}: id {} is in the image ({} pixels) but not among its {} segments", whose,
                       id, area, image.segments.size());
    }
    listed->second.area = area;
  }
  return segments;
}

Expected<void> CheckImages(const cv::Mat& truth, const cv::Mat& prediction) {
  for (const cv::Mat* image : {&truth, &prediction}) {
    if (image->type() != CV_32SC1 || image->empty()) {
      return DataError("an image of ids is empty or of OpenCV type {}, expected 32-bit integers",
                       image->type());
    }
  }
  if (truth.size() != prediction.size()) {
    return DataError("the prediction is {}x{} pixels, the truth {}x{}: expected the same size",
                     prediction.cols, prediction.rows, truth.cols, truth.rows);
  }
  return {};
}

}  // namespace

LabelPairs CountLabelPairs(const cv::Mat& truth, const cv::Mat& prediction) {
  LabelPairs pairs;
  // Runs of one pair are long, so the map is asked once a run.
  for (int y = 0; y < truth.rows; ++y) {
    const auto* true_row = truth.ptr<std::int32_t>(y);
    const auto* predicted_row = prediction.ptr<std::int32_t>(y);
    int begin = 0;
    for (int x = 1; x <= truth.cols; ++x) {
      if (x < truth.cols && true_row[x] == true_row[begin] &&
          predicted_row[x] == predicted_row[begin]) {
        continue;
      }
      pairs[{true_row[begin], predicted_row[begin]}] += x - begin;
      begin = x;
    }
  }
  return pairs;
}

PanopticImage SegmentsOfLabels(const cv::Mat& labels, std::int32_t divisor) {
  PanopticImage image;
  image.ids = labels.clone();
  std::set<std::int32_t> found;
  for (int y = 0; y < labels.rows; ++y) {
    auto* row = image.ids.ptr<std::int32_t>(y);
    for (int x = 0; x < labels.cols; ++x) {
      if (row[x] / divisor == 0) row[x] = kVoid;
      if (row[x] != kVoid && (x == 0 || row[x] != row[x - 1])) found.insert(row[x]);
    }
  }
  for (const std::int32_t label : found) image.segments.push_back({label, label / divisor, false});
  return image;
}

void Add(const PanopticCounts& more, PanopticCounts& to) {
  for (const auto& [class_id, counts] : more) {
    ClassCounts& sum = to[class_id];
    sum.true_positives += counts.true_positives;
    sum.false_positives += counts.false_positives;
    sum.false_negatives += counts.false_negatives;
    sum.iou_sum += counts.iou_sum;
  }
}

Expected<PanopticCounts> CountPanoptic(const PanopticImage& truth,
                                       const PanopticImage& prediction) {
  TSDFPP_RETURN_IF_ERROR(CheckImages(truth.ids, prediction.ids));
  const LabelPairs overlaps = CountLabelPairs(truth.ids, prediction.ids);
  std::map<std::int32_t, std::int64_t> true_areas;
  std::map<std::int32_t, std::int64_t> predicted_areas;
  for (const auto& [ids, pixels] : overlaps) {
    true_areas[ids.first] += pixels;
    predicted_areas[ids.second] += pixels;
  }
  TSDFPP_ASSIGN(Segments true_segments, ListSegments(truth, true_areas, "truth"));
  TSDFPP_ASSIGN(Segments predicted, ListSegments(prediction, predicted_areas, "prediction"));
  for (const auto& [id, listed] : predicted) {
    if (listed.area == 0) {
      return DataError("prediction: segment {} is listed but no pixel of the image has it", id);
    }
  }
  const auto overlap = [&](std::int32_t true_id, std::int32_t predicted_id) {
    const auto entry = overlaps.find({true_id, predicted_id});
    return entry == overlaps.end() ? std::int64_t{0} : entry->second;
  };

  PanopticCounts counts;
  for (const auto& [ids, intersection] : overlaps) {
    if (ids.first == kVoid || ids.second == kVoid) continue;
    Listed& ours = predicted.at(ids.second);
    Listed& theirs = true_segments.at(ids.first);
    if (theirs.segment.is_crowd || theirs.segment.class_id != ours.segment.class_id) continue;
    const std::int64_t in_union =
        ours.area + theirs.area - intersection - overlap(kVoid, ids.second);
    const double iou = static_cast<double>(intersection) / static_cast<double>(in_union);
    if (!(iou > 0.5)) continue;
    ours.matched = true;
    theirs.matched = true;
    ++counts[ours.segment.class_id].true_positives;
    counts[ours.segment.class_id].iou_sum += iou;
  }
  for (const auto& [id, listed] : true_segments) {
    if (!listed.matched && !listed.segment.is_crowd) {
      ++counts[listed.segment.class_id].false_negatives;
    }
  }
  for (const auto& [id, listed] : predicted) {
    if (listed.matched) continue;
    std::int64_t excused = overlap(kVoid, id);
    for (const auto& [true_id, theirs] : true_segments) {
      if (theirs.segment.is_crowd && theirs.segment.class_id == listed.segment.class_id) {
        excused += overlap(true_id, id);
      }
    }
    if (2 * excused > listed.area) continue;
    ++counts[listed.segment.class_id].false_positives;
  }
  return counts;
}

PanopticQuality QualityOf(const ClassCounts& counts) {
  const auto hits = static_cast<double>(counts.true_positives);
  const double weight = hits + 0.5 * static_cast<double>(counts.false_positives) +
                        0.5 * static_cast<double>(counts.false_negatives);
  if (!(weight > 0)) {
    const Measured undefined = Measured::Undefined("the class has no segments");
    return {undefined, undefined, undefined};
  }
  return {Measured::Of(counts.iou_sum / weight),
          hits > 0 ? Measured::Of(counts.iou_sum / hits)
                   : Measured::Undefined("the class has no true positive"),
          Measured::Of(hits / weight)};
}

MeanPanopticQuality MeanQuality(const PanopticCounts& counts) {
  std::set<int> classes;
  for (const auto& [class_id, of_class] : counts) classes.insert(class_id);
  return MeanQuality(counts, classes);
}

MeanPanopticQuality MeanQuality(const PanopticCounts& counts, const std::set<int>& classes) {
  double pq = 0;
  double sq = 0;
  double rq = 0;
  MeanPanopticQuality result;
  for (const auto& [class_id, of_class] : counts) {
    const PanopticQuality quality = QualityOf(of_class);
    if (!classes.contains(class_id) || !quality.pq.value) continue;
    pq += *quality.pq.value;
    sq += quality.sq.value.value_or(0);
    rq += *quality.rq.value;
    ++result.classes;
  }
  if (result.classes == 0) {
    const Measured undefined = Measured::Undefined("no class has a segment");
    result.mean = {undefined, undefined, undefined};
    return result;
  }
  result.mean = {Measured::Of(pq / result.classes), Measured::Of(sq / result.classes),
                 Measured::Of(rq / result.classes)};
  return result;
}

void LabelOverlap::Observe(const cv::Mat& truth, const cv::Mat& prediction, std::int32_t ignored) {
  std::map<std::int32_t, Areas> frame;
  for (const auto& [labels, pixels] : CountLabelPairs(truth, prediction)) {
    if (labels.first == ignored) continue;
    frame[labels.first].in_union += pixels;
    if (labels.first == labels.second) {
      frame[labels.first].intersection += pixels;
    } else if (labels.second != ignored) {
      frame[labels.second].in_union += pixels;
    }
  }
  if (frame.empty()) return;
  double sum = 0;
  for (const auto& [label, of_frame] : frame) {
    sum += static_cast<double>(of_frame.intersection) / static_cast<double>(of_frame.in_union);
    Areas& total = areas_[label];
    total.intersection += of_frame.intersection;
    total.in_union += of_frame.in_union;
  }
  frame_means_ += sum / static_cast<double>(frame.size());
  ++frames_;
}

std::map<std::int32_t, double> LabelOverlap::ByLabel() const {
  std::map<std::int32_t, double> result;
  for (const auto& [label, total] : areas_) {
    result[label] = static_cast<double>(total.intersection) / static_cast<double>(total.in_union);
  }
  return result;
}

Measured LabelOverlap::PerFrameMean() const {
  if (frames_ == 0) return Measured::Undefined("no frame has a labelled pixel");
  return Measured::Of(frame_means_ / frames_);
}

}  // namespace tsdfpp
