#include "metrics/segmentation.h"

#include <gtest/gtest.h>

#include <opencv2/imgcodecs.hpp>

#include "metrics/tracking_quality.h"
#include "tests/metrics/reference_files.h"

namespace tsdfpp {
namespace {

const std::filesystem::path kPanoptic = test::CopiedData("panoptic");
const std::filesystem::path kShelf = test::CopiedData("apc_shelf_masks");
constexpr double kDouble = 1e-12;

cv::Mat Labels(const std::vector<std::vector<int>>& rows) {
  cv::Mat image(static_cast<int>(rows.size()), static_cast<int>(rows.front().size()), CV_32SC1);
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols; ++x) {
      image.at<std::int32_t>(y, x) = rows[static_cast<std::size_t>(y)][static_cast<std::size_t>(x)];
    }
  }
  return image;
}

cv::Mat ReadLabels(const std::filesystem::path& path) {
  cv::Mat labels;
  cv::imread(path.string(), cv::IMREAD_UNCHANGED).convertTo(labels, CV_32SC1);
  return labels;
}

// Ids of a panopticapi image, R + 256 G + 65536 B.
cv::Mat ReadRgbIds(const std::filesystem::path& path) {
  const cv::Mat bgr = cv::imread(path.string(), cv::IMREAD_COLOR);
  cv::Mat ids(bgr.size(), CV_32SC1);
  for (int y = 0; y < bgr.rows; ++y) {
    for (int x = 0; x < bgr.cols; ++x) {
      const auto& p = bgr.at<cv::Vec3b>(y, x);
      ids.at<std::int32_t>(y, x) = p[2] + 256 * p[1] + 65536 * p[0];
    }
  }
  return ids;
}

void ExpectClass(const ClassCounts& counts, const nlohmann::json& expected) {
  EXPECT_EQ(counts.true_positives, expected["tp"].get<int>());
  EXPECT_EQ(counts.false_positives, expected["fp"].get<int>());
  EXPECT_EQ(counts.false_negatives, expected["fn"].get<int>());
  const PanopticQuality quality = QualityOf(counts);
  if (expected.contains("pq")) {
    EXPECT_NEAR(*quality.pq.value, expected["pq"], kDouble);
    EXPECT_NEAR(quality.sq.value.value_or(0), expected["sq"], kDouble);
    EXPECT_NEAR(*quality.rq.value, expected["rq"], kDouble);
  }
  if (expected.contains("iou")) {
    EXPECT_NEAR(counts.iou_sum, expected["iou"], 1e-9);
  }
}

void ExpectMean(const MeanPanopticQuality& quality, const nlohmann::json& expected) {
  EXPECT_NEAR(*quality.mean.pq.value, expected["pq"], kDouble);
  EXPECT_NEAR(*quality.mean.sq.value, expected["sq"], kDouble);
  EXPECT_NEAR(*quality.mean.rq.value, expected["rq"], kDouble);
  EXPECT_EQ(quality.classes, expected["n"].get<int>());
}

// 50 COCO segments in two images, three of them crowds, with void.
TEST(Panoptic, EqualsPanopticapi) {
  const std::filesystem::path folder = kPanoptic / "panopticapi_sample";
  const auto expected = testing::ReadJson(folder / "expected.json");
  const auto truth = testing::ReadJson(folder / "gt.json");
  const auto prediction = testing::ReadJson(folder / "pred.json");
  const auto read = [&](const nlohmann::json& annotation, const char* name) {
    PanopticImage image;
    image.ids = ReadRgbIds(folder / name / annotation["file_name"].get<std::string>());
    for (const auto& info : annotation["segments_info"]) {
      image.segments.push_back({info["id"], info["category_id"], info.value("iscrowd", 0) == 1});
    }
    return image;
  };
  PanopticCounts counts;
  int crowds = 0;
  for (const auto& annotation : truth["annotations"]) {
    const PanopticImage true_image = read(annotation, "gt");
    for (const auto& segment : true_image.segments) crowds += segment.is_crowd ? 1 : 0;
    for (const auto& other : prediction["annotations"]) {
      if (other["image_id"] != annotation["image_id"]) continue;
      const auto of_image = CountPanoptic(true_image, read(other, "pred"));
      ASSERT_TRUE(of_image) << of_image.error().message;
      Add(*of_image, counts);
    }
  }
  EXPECT_EQ(crowds, 3);
  ClassCounts total;
  for (const auto& [class_id, of_class] : counts) {
    SCOPED_TRACE(class_id);
    ExpectClass(of_class, expected["per_class"][std::to_string(class_id)]);
    total.true_positives += of_class.true_positives;
    total.false_positives += of_class.false_positives;
    total.false_negatives += of_class.false_negatives;
    total.iou_sum += of_class.iou_sum;
  }
  EXPECT_EQ(counts.size(), expected["per_class"].size());
  ExpectClass(total, expected["totals"]);
  std::map<bool, std::set<int>> kinds;
  for (const auto& category : truth["categories"]) {
    kinds[category["isthing"] == 1].insert(category["id"].get<int>());
  }
  ExpectMean(MeanQuality(counts), expected["All"]);
  ExpectMean(MeanQuality(counts, kinds[true]), expected["Things"]);
  ExpectMean(MeanQuality(counts, kinds[false]), expected["Stuff"]);
}

TEST(Panoptic, EqualsDeeplab2) {
  const std::filesystem::path folder = kPanoptic / "deeplab2_pq";
  const auto expected = testing::ReadJson(folder / "expected.json");
  for (const char* key : {"single_team", "multi"}) {
    SCOPED_TRACE(key);
    const auto& numbers = expected[key];
    PanopticCounts counts;
    for (const std::string name : numbers["files"]) {
      const auto of_image =
          CountPanoptic(SegmentsOfLabels(ReadLabels(folder / (name + ".gt.png")), 1000),
                        SegmentsOfLabels(ReadLabels(folder / (name + ".pred.png")), 1000));
      ASSERT_TRUE(of_image) << of_image.error().message;
      Add(*of_image, counts);
    }
    const MeanPanopticQuality quality = MeanQuality(counts);
    // What deeplab2's test asserts, to its tolerance, and panopticapi's digits of the same.
    const double tolerance = numbers["tolerance"];
    EXPECT_NEAR(*quality.mean.pq.value, numbers["expected"]["PQ"], tolerance);
    EXPECT_NEAR(*quality.mean.sq.value, numbers["expected"]["SQ"], tolerance);
    EXPECT_NEAR(*quality.mean.rq.value, numbers["expected"]["RQ"], tolerance);
    ExpectMean(quality, numbers["panopticapi"]);
    for (const auto& [class_id, of_class] : counts) {
      ExpectClass(of_class, numbers["panopticapi"]["per_class"][std::to_string(class_id)]);
    }
  }
}

TEST(Panoptic, EqualsTorchmetrics) {
  const auto example = testing::ReadJson(kPanoptic / "torchmetrics_pq.json");
  // Classes from 1, since 0 is void; instances of stuff (6, 7) do not count.
  const auto read = [&](const char* key) {
    std::vector<std::vector<int>> rows;
    for (const auto& row : example[key]) {
      rows.emplace_back();
      for (const auto& pixel : row) {
        const int class_id = pixel[0];
        const int instance = pixel[1];
        rows.back().push_back((class_id + 1) * 10 + (class_id < 6 ? instance : 0));
      }
    }
    return SegmentsOfLabels(Labels(rows), 10);
  };
  const auto counts = CountPanoptic(read("target"), read("preds"));
  ASSERT_TRUE(counts) << counts.error().message;
  ExpectMean(MeanQuality(*counts), example["panopticapi"]);
  for (const auto& [class_id, of_class] : *counts) {
    ExpectClass(of_class, example["panopticapi"]["per_class"][std::to_string(class_id - 1)]);
  }
}

// 15 frames of a real network's masks: the predicted sets of labels are one of bits.
cv::Mat LowestBit(const cv::Mat& bits) {
  cv::Mat labels = cv::Mat::zeros(bits.size(), CV_32SC1);
  for (int y = 0; y < bits.rows; ++y) {
    for (int x = 0; x < bits.cols; ++x) {
      const int value = bits.at<std::int32_t>(y, x);
      for (int bit = 0; bit < 16; ++bit) {
        if ((value >> bit & 1) == 0) continue;
        labels.at<std::int32_t>(y, x) = bit + 1;
        break;
      }
    }
  }
  return labels;
}

TEST(Panoptic, EqualsReferencesOnARealShelf) {
  const auto expected = testing::ReadJson(kShelf / "expected_metrics.json");
  for (const auto& [name, numbers] : expected["results"].items()) {
    SCOPED_TRACE(name);
    // In one, the network's ids 2 and 3 are swapped in the frames from 8 on.
    const bool swaps_ids = name.find("idswitch") != std::string::npos;
    PanopticCounts per_object;
    PanopticCounts agnostic;
    TrackingQuality tracking({2, {1}, -1, 16});
    for (int frame = 0; frame < 15; ++frame) {
      const auto file = [&](const char* what) {
        return kShelf / ("frame-0000" + std::string(frame < 10 ? "0" : "") + std::to_string(frame) +
                         "." + what + ".png");
      };
      const cv::Mat truth = ReadLabels(file("label"));
      cv::Mat prediction =
          name == "gt_as_pred" ? truth.clone() : LowestBit(ReadLabels(file("pred")));
      if (swaps_ids && frame >= 8) {
        for (auto label = prediction.begin<std::int32_t>(); label != prediction.end<std::int32_t>();
             ++label) {
          if (*label == 2 || *label == 3) *label = 5 - *label;
        }
      }
      // Each object a class, the background class 1.
      const auto objects =
          CountPanoptic(SegmentsOfLabels(truth + 1, 1), SegmentsOfLabels(prediction + 1, 1));
      ASSERT_TRUE(objects) << objects.error().message;
      Add(*objects, per_object);
      // Two classes: background, and any object with its label as its instance.
      const auto two_classes = [](const cv::Mat& labels, int first, int step) {
        cv::Mat out(labels.size(), CV_32SC1);
        for (int y = 0; y < labels.rows; ++y) {
          for (int x = 0; x < labels.cols; ++x) {
            const int label = labels.at<std::int32_t>(y, x);
            out.at<std::int32_t>(y, x) = label == 0 ? first * step : (first + 1) * step + label;
          }
        }
        return out;
      };
      const auto any = CountPanoptic(SegmentsOfLabels(two_classes(truth, 1, 1000), 1000),
                                     SegmentsOfLabels(two_classes(prediction, 1, 1000), 1000));
      ASSERT_TRUE(any) << any.error().message;
      Add(*any, agnostic);
      const auto seen =
          tracking.Observe(two_classes(truth, 0, 1 << 16), two_classes(prediction, 0, 1 << 16));
      ASSERT_TRUE(seen) << seen.error().message;
    }
    ExpectMean(MeanQuality(per_object), numbers["PQ_class_per_object"]);
    for (const auto& [class_id, of_class] : per_object) {
      ExpectClass(of_class,
                  numbers["PQ_class_per_object"]["per_class"][std::to_string(class_id - 1)]);
    }
    ExpectMean(MeanQuality(agnostic), numbers["PQ_class_agnostic"]);
    const TrackingQuality::Scores scores = tracking.Result();
    EXPECT_NEAR(*scores.stq.value, numbers["STQ_class_agnostic"]["STQ"], kDouble);
    EXPECT_NEAR(*scores.aq.value, numbers["STQ_class_agnostic"]["AQ"], kDouble);
    EXPECT_NEAR(*scores.iou.value, numbers["STQ_class_agnostic"]["IoU"], kDouble);
  }
}

ClassCounts CountOne(const std::vector<std::vector<int>>& truth,
                     const std::vector<std::vector<int>>& prediction,
                     const std::vector<int>& crowds = {}) {
  PanopticImage image = SegmentsOfLabels(Labels(truth), 10);
  for (PanopticSegment& segment : image.segments) {
    segment.is_crowd = std::find(crowds.begin(), crowds.end(), segment.id) != crowds.end();
  }
  auto counts = CountPanoptic(image, SegmentsOfLabels(Labels(prediction), 10));
  EXPECT_TRUE(counts) << counts.error().message;
  return counts ? (*counts)[1] : ClassCounts{};
}

void ExpectCounts(const ClassCounts& counts, int tp, int fp, int fn, double iou) {
  EXPECT_EQ(counts.true_positives, tp);
  EXPECT_EQ(counts.false_positives, fp);
  EXPECT_EQ(counts.false_negatives, fn);
  EXPECT_NEAR(counts.iou_sum, iou, kDouble);
}

TEST(Panoptic, AMatchNeedsMoreThanHalf) {
  // 2 of 3 pixels; then 1 of 2, which is exactly a half.
  ExpectCounts(CountOne({{11, 11, 11, 20}}, {{11, 11, 20, 20}}), 1, 0, 0, 2.0 / 3);
  ExpectCounts(CountOne({{11, 11, 20}}, {{11, 20, 20}}), 0, 1, 1, 0);
  // Another class is no match.
  ExpectCounts(CountOne({{11, 11}}, {{21, 21}}), 0, 0, 1, 0);
}

TEST(Panoptic, VoidIsLeftOutOfTheUnion) {
  // 2 pixels true, 2 void; the prediction has all four.
  ExpectCounts(CountOne({{11, 11, 0, 0}}, {{11, 11, 11, 11}}), 1, 0, 0, 1);
  // Unmatched, and more than half of it on void: not held against it. Exactly a half is.
  ExpectCounts(CountOne({{0, 0, 20}}, {{11, 11, 11}}), 0, 0, 0, 0);
  ExpectCounts(CountOne({{0, 0, 20, 20}}, {{11, 11, 11, 11}}), 0, 1, 0, 0);
  // What the prediction leaves void is missing, no false positive.
  ExpectCounts(CountOne({{11, 11, 20}}, {{0, 0, 20}}), 0, 0, 1, 0);
}

TEST(Panoptic, ACrowdExcusesItsOwnClassOnly) {
  ExpectCounts(CountOne({{15, 15, 15, 15, 20}}, {{11, 11, 12, 12, 20}}, {15}), 0, 0, 0, 0);
  ExpectCounts(CountOne({{25, 25, 25, 25, 20}}, {{11, 11, 12, 12, 20}}, {25}), 0, 2, 0, 0);
  // Void and crowd together.
  ExpectCounts(CountOne({{0, 15, 20}}, {{11, 11, 11}}, {15}), 0, 0, 0, 0);
  // A crowd is no match, however well it fits, and is not missed.
  ExpectCounts(CountOne({{15, 15}}, {{11, 11}}, {15}), 0, 0, 0, 0);
  ExpectCounts(CountOne({{15, 15}}, {{20, 20}}, {15}), 0, 0, 0, 0);
}

TEST(Panoptic, QualityOfKnownCounts) {
  const PanopticQuality quality = QualityOf({2, 1, 3, 1.5});
  EXPECT_DOUBLE_EQ(*quality.pq.value, 1.5 / 4);
  EXPECT_DOUBLE_EQ(*quality.sq.value, 0.75);
  EXPECT_DOUBLE_EQ(*quality.rq.value, 0.5);
  EXPECT_EQ(QualityOf({}).pq.why_not, "the class has no segments");
  EXPECT_EQ(QualityOf({0, 1, 0, 0}).sq.why_not, "the class has no true positive");
  EXPECT_EQ(*QualityOf({0, 1, 0, 0}).pq.value, 0);
  const PanopticCounts counts = {{1, {2, 1, 3, 1.5}}, {2, {0, 0, 2, 0}}, {3, {}}};
  const MeanPanopticQuality mean = MeanQuality(counts);
  EXPECT_EQ(mean.classes, 2);
  EXPECT_DOUBLE_EQ(*mean.mean.pq.value, 1.5 / 8);
  EXPECT_DOUBLE_EQ(*mean.mean.sq.value, 0.375);
  EXPECT_FALSE(MeanQuality(counts, {3}).mean.pq.value);
  EXPECT_FALSE(MeanQuality({}).mean.pq.value);
}

TEST(Panoptic, BadImagesAreRefused) {
  const PanopticImage good = SegmentsOfLabels(Labels({{11, 21}}), 10);
  const auto message = [&](const PanopticImage& truth, const PanopticImage& prediction) {
    const auto counts = CountPanoptic(truth, prediction);
    return counts ? std::string() : counts.error().message;
  };
  EXPECT_EQ(message(good, good), "");
  EXPECT_EQ(message(good, SegmentsOfLabels(Labels({{11}}), 10)),
            "the prediction is 1x1 pixels, the truth 2x1: expected the same size");
  PanopticImage other = good;
  other.segments.pop_back();
  EXPECT_EQ(message(good, other),
            "prediction: id 21 is in the image (1 pixels) but not among its 1 segments");
  other = good;
  other.segments.push_back({5, 1, false});
  EXPECT_EQ(message(good, other),
            "prediction: segment 5 is listed but no pixel of the image has it");
  other.segments.back().id = 11;
  EXPECT_EQ(message(other, good), "truth: segment id 11 is listed twice");
  other.ids = cv::Mat(1, 2, CV_16UC1);
  EXPECT_NE(message(other, good).find("32-bit"), std::string::npos);
}

TEST(LabelOverlap, SumsOverTheSequenceAndAveragesFrames) {
  LabelOverlap overlap;
  EXPECT_FALSE(overlap.PerFrameMean().value);
  overlap.Observe(Labels({{1, 1, 2, 2}}), Labels({{1, 1, 2, 2}}));
  overlap.Observe(Labels({{1, 1, 1, 3}}), Labels({{1, 2, 2, 3}}));
  const auto by_label = overlap.ByLabel();
  EXPECT_DOUBLE_EQ(by_label.at(1), 3.0 / 5);
  EXPECT_DOUBLE_EQ(by_label.at(2), 2.0 / 4);
  EXPECT_DOUBLE_EQ(by_label.at(3), 1);
  // Frame 2: 1/3, 0, 1.
  EXPECT_DOUBLE_EQ(*overlap.PerFrameMean().value, (1 + 4.0 / 9) / 2);
  LabelOverlap ignoring;
  ignoring.Observe(Labels({{1, 0, 0}}), Labels({{1, 1, 2}}), 0);
  EXPECT_EQ(ignoring.ByLabel(), (std::map<std::int32_t, double>{{1, 1.0}}));
}

// What a prediction leaves open is no label of its own, and is missed in the truth's.
TEST(LabelOverlap, VoidOfThePredictionIsNoLabel) {
  LabelOverlap overlap;
  overlap.Observe(Labels({{1, 1, 1, 1}}), Labels({{1, 1, 1, 0}}), 0);
  EXPECT_EQ(overlap.ByLabel(), (std::map<std::int32_t, double>{{1, 0.75}}));
  EXPECT_EQ(overlap.PerFrameMean().value, 0.75);
  // Where none is ignored, 0 is one as any other.
  LabelOverlap objects;
  objects.Observe(Labels({{1, 1, 1, 1}}), Labels({{1, 1, 1, 0}}));
  EXPECT_EQ(objects.ByLabel(), (std::map<std::int32_t, double>{{0, 0.0}, {1, 0.75}}));
}

TEST(TrackingQuality, EqualsDeeplab2) {
  const auto reference = testing::ReadJson(kPanoptic / "deeplab2_stq.json");
  ASSERT_EQ(reference["cases"].size(), 13U);
  for (const auto& example : reference["cases"]) {
    TrackingQuality quality({example["num_classes"], example["things"].get<std::set<int>>(),
                             example["ignore_label"], example["label_bit_shift"]});
    for (std::size_t frame = 0; frame < example["frames_gt"].size(); ++frame) {
      // A frame may be one row.
      const auto read = [&](const nlohmann::json& rows) {
        return rows.front().is_array() ? Labels(rows.get<std::vector<std::vector<int>>>())
                                       : Labels({rows.get<std::vector<int>>()});
      };
      const auto seen =
          quality.Observe(read(example["frames_gt"][frame]), read(example["frames_pred"][frame]));
      ASSERT_TRUE(seen) << seen.error().message;
    }
    const TrackingQuality::Scores scores = quality.Result();
    EXPECT_NEAR(*scores.stq.value, example["STQ"], kDouble);
    EXPECT_NEAR(*scores.aq.value, example["AQ"], kDouble);
    EXPECT_NEAR(*scores.iou.value, example["IoU"], kDouble);
  }
}

TEST(TrackingQuality, IgnoredPixelsAndUndefinedScores) {
  constexpr int kThing = 1 << 16;
  constexpr int kIgnored = 9 << 16;
  TrackingQuality quality({2, {1}, 9, 16});
  EXPECT_FALSE(quality.Result().iou.value);
  EXPECT_FALSE(quality.Result().stq.value);
  // Ignored pixels take nothing from IoU.
  ASSERT_TRUE(quality.Observe(Labels({{0, 0, kThing + 1, kIgnored}}),
                              Labels({{0, 0, kThing + 1, kThing + 1}})));
  EXPECT_DOUBLE_EQ(*quality.Result().iou.value, 1);
  // But the tube is a pixel too long: IoU of the tubes 1/2.
  EXPECT_DOUBLE_EQ(*quality.Result().aq.value, 0.5);
  TrackingQuality no_tubes({2, {1}, -1, 16});
  ASSERT_TRUE(no_tubes.Observe(Labels({{0, 0}}), Labels({{0, 0}})));
  EXPECT_EQ(no_tubes.Result().stq.why_not, "the truth has no instance to follow");
  EXPECT_FALSE(no_tubes.Observe(Labels({{kIgnored, 0}}), Labels({{0, 0}})));
  EXPECT_FALSE(no_tubes.Observe(Labels({{0}}), Labels({{0, 0}})));
}

}  // namespace
}  // namespace tsdfpp
