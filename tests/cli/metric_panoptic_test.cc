// `tsdfpp metric panoptic` on files, as a user calls it: the numbers of other programs, and bad
// inputs.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "core/files.h"
#include "tests/cli/metric_runner.h"
#include "tests/needs.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;
using test::kData;
using test::kUsage;

class MetricPanoptic : public test::MetricRunner {};

TEST_F(MetricPanoptic, PrintsPanopticapisNumbers) {
  const fs::path sample = test::CopiedData("panoptic/panopticapi_sample");
  std::ifstream file(sample / "expected.json");
  const auto expected = nlohmann::json::parse(file);
  const auto json = Json({"panoptic", sample / "gt", sample / "pred", "--encoding", "coco"});
  constexpr double kDouble = 1e-12;
  for (const auto& [ours, theirs] :
       {std::pair{"all", "All"}, {"things", "Things"}, {"stuff", "Stuff"}}) {
    for (const char* key : {"pq", "sq", "rq"}) {
      EXPECT_NEAR(json[ours][key], expected[theirs][key], kDouble) << ours << key;
    }
    EXPECT_EQ(json[ours]["classes"], expected[theirs]["n"]);
  }
  EXPECT_EQ(json["per_class"]["1"]["fn"], 24);
  EXPECT_TRUE(json["per_class"]["37"]["sq"]["value"].is_null());
}

TEST_F(MetricPanoptic, AnAnnotationIsThereOnce) {
  const fs::path sample = test::CopiedData("panoptic/panopticapi_sample");
  fs::copy(sample, folder_ / "sample", fs::copy_options::recursive);
  const std::string text = ReadFile(sample / "pred.json").value();
  const nlohmann::json sound = nlohmann::json::parse(text);
  const auto refused = [&](const nlohmann::json& edited, const std::string& words) {
    ASSERT_TRUE(WriteFile(folder_ / "sample/pred.json", edited.dump()).has_value());
    ExpectError({"panoptic", folder_ / "sample/gt", folder_ / "sample/pred", "--encoding", "coco"},
                kData, {"pred.json", words});
  };
  nlohmann::json edited = sound;
  edited["annotations"].push_back(sound["annotations"][0]);
  refused(edited, "is there twice");
  edited = sound;
  edited["annotations"][0]["segments_info"][0]["iscrowd"] = 2;
  refused(edited, "'iscrowd' is 2, expected 0 or 1");
  edited = sound;
  edited["annotations"] = {{"a", sound["annotations"][0]}};
  refused(edited, "'annotations' is no list");
  edited = sound;
  edited["categories"] = {{{"id", 1}, {"isthing", 1}}, {{"id", 1}, {"isthing", 0}}};
  refused(edited, "category 1 is there twice");
  // One of an image that the truth lacks is left out, and said.
  edited = sound;
  nlohmann::json other = sound["annotations"][0];
  other["file_name"] = "other.png";
  other["image_id"] = 123456789;
  edited["annotations"].push_back(other);
  ASSERT_TRUE(WriteFile(folder_ / "sample/pred.json", edited.dump()).has_value());
  const auto run = test::RunTsdfpp(
      {"metric", "panoptic", folder_ / "sample/gt", folder_ / "sample/pred", "--encoding", "coco"},
      folder_.path());
  EXPECT_EQ(run.exit_code, 0) << run.err;
  EXPECT_NE(run.err.find("1 of its images are not in"), std::string::npos) << run.err;
}

TEST_F(MetricPanoptic, PrintsDeeplab2sNumbers) {
  const fs::path deeplab = test::CopiedData("panoptic/deeplab2_pq");
  std::ifstream file(deeplab / "expected.json");
  const auto expected = nlohmann::json::parse(file)["multi"];
  for (const char* name : {"bird", "cat", "team"}) {
    for (const char* side : {"gt", "pred"}) {
      fs::create_directories(folder_ / side);
      fs::copy_file(deeplab / fmt::format("{}.{}.png", name, side),
                    folder_ / side / fmt::format("{}.png", name));
    }
  }
  const auto json = Json({"panoptic", folder_ / "gt", folder_ / "pred"});
  EXPECT_NEAR(json["all"]["pq"], expected["panopticapi"]["pq"], 1e-12);
  EXPECT_NEAR(json["all"]["pq"], expected["expected"]["PQ"], expected["tolerance"]);
  EXPECT_EQ(json["images"], 3);
  EXPECT_FALSE(json.contains("stq"));
}

// Two frames: the object's id changes in the second.
TEST_F(MetricPanoptic, OfObjectIds) {
  fs::create_directories(folder_ / "gt");
  fs::create_directories(folder_ / "pred");
  const auto write = [&](const char* path, int id) {
    cv::Mat image(4, 4, CV_16UC1, cv::Scalar(0));
    image.row(0).setTo(id);
    cv::imwrite((folder_ / path).string(), image);
  };
  write("gt/1.png", 7);
  write("gt/2.png", 7);
  write("pred/1.png", 7);
  write("pred/2.png", 9);
  const auto json = Json({"panoptic", folder_ / "gt", folder_ / "pred", "--encoding", "objects"});
  EXPECT_EQ(json["per_class"]["0"]["pq"], 1);
  EXPECT_NEAR(json["per_class"]["7"]["pq"], 1 / 1.5, 1e-12);
  EXPECT_EQ(json["per_class"]["9"]["fp"], 1);
  EXPECT_EQ(json["iou"]["by_label"]["7"], 0.5);
  EXPECT_NEAR(json["iou"]["per_frame_mean"], (1 + 1.0 / 3) / 2, 1e-12);
  // One tube of 8 pixels, in two halves: each 4 / 8.
  EXPECT_EQ(json["stq"]["aq"], 0.5);
  EXPECT_EQ(json["stq"]["iou"], 1);
}

TEST_F(MetricPanoptic, RefusesWhatItCannotUse) {
  fs::create_directories(folder_ / "gt");
  fs::create_directories(folder_ / "pred");
  const std::string gt = folder_ / "gt";
  const std::string pred = folder_ / "pred";
  ExpectError({"panoptic", gt, pred}, kData, {"gt", "no .png"});
  ExpectError({"panoptic", folder_ / "none", pred}, kData, {"none"});
  cv::imwrite(fmt::format("{}/1.png", gt), cv::Mat(4, 4, CV_16UC1, cv::Scalar(1001)));
  cv::imwrite(fmt::format("{}/2.png", gt), cv::Mat(4, 4, CV_16UC1, cv::Scalar(1001)));
  cv::imwrite(fmt::format("{}/1.png", pred), cv::Mat(4, 5, CV_16UC1, cv::Scalar(1001)));
  ExpectError({"panoptic", gt, pred}, kData, {"lacks 1 of the 2 images", "2.png"});
  cv::imwrite(fmt::format("{}/2.png", pred), cv::Mat(4, 4, CV_8UC3, cv::Scalar(1, 2, 3)));
  ExpectError({"panoptic", gt, pred}, kData, {"1.png", "5x4"});
  cv::imwrite(fmt::format("{}/1.png", pred), cv::Mat(4, 4, CV_16UC1, cv::Scalar(1001)));
  ExpectError({"panoptic", gt, pred}, kData, {"2.png", "colour"});
  Write("pred/2.png", "no image");
  ExpectError({"panoptic", gt, pred}, kData, {"2.png"});
  ExpectError({"panoptic", gt, pred, "--encoding", "coco"}, kData, {"gt.json"});
  Write("gt.json", "{\"annotations\": 3}");
  ExpectError({"panoptic", gt, pred, "--encoding", "coco"}, kData, {"gt.json", "COCO"});
  ExpectError({"panoptic", gt, pred, "--encoding", "cocoa"}, kUsage, {"cocoa"});
  ExpectError({"panoptic", gt, pred, "--things", "x"}, kUsage, {"--things", "x"});
  ExpectError({"panoptic", gt, pred, "--gt-json", "a"}, kUsage, {"--gt-json"});
}

}  // namespace
}  // namespace tsdfpp
