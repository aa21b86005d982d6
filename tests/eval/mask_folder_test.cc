// Masks that others wrote, by the names that they give them.
#include "eval/run/mask_folder.h"

#include <gtest/gtest.h>

#include <opencv2/imgcodecs.hpp>

#include "core/files.h"
#include "eval/score/evaluate_masks.h"
#include "tests/core/temp_folder.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;

class MaskFolderTest : public testing::Test {
 protected:
  // An image of 6x4 that is `value` in the box and 0 elsewhere.
  void Write(const std::string& name, const cv::Rect& box, double value, int type = CV_8UC1,
             cv::Size size = {6, 4}) {
    cv::Mat image(size, type, cv::Scalar(0));
    image(box).setTo(value);
    fs::create_directories((folder_ / name).parent_path());
    ASSERT_TRUE(cv::imwrite((folder_ / name).string(), image));
  }
  static Frame FrameNumber(int index) {
    Frame frame;
    frame.index = index;
    frame.depth = cv::Mat(4, 6, CV_32FC1, cv::Scalar(1));
    return frame;
  }
  std::vector<Instance> Find(int index) {
    return MaskFolder::Open(folder_.path()).value()->Find(FrameNumber(index)).value();
  }
  std::string OpenError() {
    const auto opened = MaskFolder::Open(folder_.path());
    return opened ? "" : opened.error().message;
  }
  test::TempFolder folder_;
};

// Co-Fusion's names, and ids of 16 bits.
TEST_F(MaskFolderTest, ImagesOfIds) {
  cv::Mat ids(4, 6, CV_16UC1, cv::Scalar(0));
  ids(cv::Rect(0, 0, 2, 2)).setTo(300);
  ids(cv::Rect(3, 1, 3, 3)).setTo(7);
  ids.at<std::uint16_t>(3, 0) = kNoInstance;
  ASSERT_TRUE(cv::imwrite((folder_ / "Mask0012.png").string(), ids));
  Write("Mask0014.png", {1, 1, 2, 1}, 5);
  const auto found = Find(12);
  ASSERT_EQ(found.size(), 2U);
  EXPECT_EQ(found[0].box, cv::Rect(3, 1, 3, 3));
  EXPECT_EQ(found[1].box, cv::Rect(0, 0, 2, 2));
  EXPECT_EQ(cv::countNonZero(found[1].mask), 4);
  EXPECT_EQ(found[1].semantic_class, "thing");
  EXPECT_EQ(Find(14).at(0).box, cv::Rect(1, 1, 2, 1));
  // Nothing was found in the frame between.
  EXPECT_TRUE(Find(13).empty());
}

TEST_F(MaskFolderTest, InstancesByNumberAsBopHasThem) {
  Write("000003_000001.png", {0, 0, 6, 4}, 255);
  Write("000003_000000.png", {1, 1, 2, 2}, 255);
  Write("000004_000000.png", {0, 0, 0, 0}, 255);
  const auto found = Find(3);
  ASSERT_EQ(found.size(), 2U);
  EXPECT_EQ(found[0].box, cv::Rect(1, 1, 2, 2));
  EXPECT_GT(found[0].score, found[1].score) << "what is smaller is on top";
  EXPECT_TRUE(Find(4).empty()) << "a mask of nothing is no instance";
}

TEST_F(MaskFolderTest, FoldersNamedAfterFramesAsSegmentAnythingLeavesThem) {
  Write("12/0.png", {0, 0, 2, 2}, 255);
  Write("12/1.png", {2, 2, 2, 2}, 255);
  Write("notes/3.png", {2, 2, 2, 2}, 255);
  Write("net-1.0/3.png", {2, 2, 2, 2}, 255);
  EXPECT_EQ(Find(12).size(), 2U);
}

TEST_F(MaskFolderTest, RefusesWithOneSentence) {
  EXPECT_NE(OpenError().find("has no image that is named after a frame"), std::string::npos);
  Write("mask.png", {0, 0, 1, 1}, 1);
  EXPECT_NE(OpenError().find("has no image that is named after a frame"), std::string::npos);
  Write("a5.png", {0, 0, 1, 1}, 1);
  const auto finder = MaskFolder::Open(folder_.path()).value();
  EXPECT_NE(finder->Find(FrameNumber(6)).error().message.find("frame 6: "), std::string::npos);
  Write("b5.png", {0, 0, 1, 1}, 1);
  EXPECT_NE(OpenError().find("are both the ids of frame 5"), std::string::npos);
  fs::remove(folder_ / "b5.png");
  Write("5_1.png", {0, 0, 1, 1}, 1);
  EXPECT_NE(OpenError().find("masks of different kinds"), std::string::npos);
  fs::remove(folder_ / "5_1.png");
  Write("a5.png", {0, 0, 1, 1}, 1, CV_8UC1, {7, 4});
  const std::string words =
      MaskFolder::Open(folder_.path()).value()->Find(FrameNumber(5)).error().message;
  EXPECT_NE(words.find("frame 5: "), std::string::npos) << words;
  EXPECT_NE(words.find("7x4"), std::string::npos) << words;
}

// Names after times would give each frame the mask of another, or none.
TEST_F(MaskFolderTest, NamesOfTimesAreRefused) {
  Write("1305031453.000000.png", {0, 0, 1, 1}, 1);
  EXPECT_NE(OpenError().find("1305031453.000000.png: is named after a time"), std::string::npos)
      << OpenError();
  fs::remove(folder_ / "1305031453.000000.png");
  Write("99999999999.png", {0, 0, 1, 1}, 1);
  EXPECT_NE(OpenError().find("99999999999 is no number of a frame"), std::string::npos)
      << OpenError();
  fs::remove(folder_ / "99999999999.png");
  Write("1305031453.50/a.png", {0, 0, 1, 1}, 1);
  EXPECT_NE(OpenError().find("1305031453.50: is named after a time"), std::string::npos)
      << OpenError();
}

TEST_F(MaskFolderTest, WhatIsThereTwiceIsRefused) {
  Write("1_3.png", {0, 0, 1, 1}, 1);
  Write("1_4.png", {0, 0, 1, 1}, 1);
  EXPECT_EQ(OpenError(), "");
  Write("a01_3.png", {0, 0, 1, 1}, 1);
  EXPECT_NE(OpenError().find("are both of frame 1"), std::string::npos) << OpenError();
  for (const char* name : {"1_3.png", "1_4.png", "a01_3.png"}) fs::remove(folder_ / name);
  Write("2/a.png", {0, 0, 1, 1}, 1);
  Write("2/b.png", {0, 0, 1, 1}, 1);
  EXPECT_EQ(OpenError(), "");
  Write("02/a.png", {0, 0, 1, 1}, 1);
  EXPECT_NE(OpenError().find("are both of frame 2"), std::string::npos) << OpenError();
}

// A frame whose image was passed over would have no instance.
TEST_F(MaskFolderTest, NoImageOfAFrameIsPassedOver) {
  Write("1.png", {0, 0, 2, 2}, 5);
  Write("2.PNG", {0, 0, 2, 2}, 5);
  const cv::Mat grey(4, 6, CV_8UC3, cv::Scalar::all(5));
  ASSERT_TRUE(cv::imwrite((folder_ / "3.ppm").string(), grey));
  for (const int frame : {1, 2, 3}) EXPECT_EQ(Find(frame).size(), 1U) << frame;
  // The first is of a frame that has its mask, the others are of none.
  for (const char* name : {"shown1.jpg", "cover.jpg", "1305031453.50.jpg"}) {
    ASSERT_TRUE(WriteFile(folder_ / name, "").has_value());
  }
  EXPECT_EQ(OpenError(), "");
  for (const char* name : {"4.jpg", "5.JPEG", "6.webp"}) {
    ASSERT_TRUE(WriteFile(folder_ / name, "").has_value());
    EXPECT_NE(OpenError().find(std::string(name) + ": is of frame "), std::string::npos)
        << OpenError();
    fs::remove(folder_ / name);
  }
  EXPECT_EQ(OpenError(), "");
}

TEST_F(MaskFolderTest, NoImageOfAnInstanceIsPassedOver) {
  Write("12/0.png", {0, 0, 2, 2}, 255);
  ASSERT_TRUE(WriteFile(folder_ / "12/0.jpg", "").has_value());
  EXPECT_EQ(OpenError(), "");
  ASSERT_TRUE(WriteFile(folder_ / "12/1.jpg", "").has_value());
  EXPECT_NE(OpenError().find("12/1.jpg: is of frame 12 "), std::string::npos) << OpenError();
}

TEST_F(MaskFolderTest, WhoScoresMasksTakesTheSameEndings) {
  Write("1.PNG", {0, 0, 2, 2}, 5);
  Write("2.pgm", {0, 0, 2, 2}, 5);
  ASSERT_TRUE(WriteFile(folder_ / "3.jpg", "").has_value());
  MaskEvaluator evaluator = MaskEvaluator::Open(folder_.path()).value();
  SequenceInfo info;
  info.first_index = 1;
  info.frame_count = 3;
  info.objects = {{kBackground, "background", "background"}, {5, "cup", "cup"}};
  for (int i = 1; i <= 3; ++i) {
    Frame frame = FrameNumber(i);
    frame.mask = cv::Mat(4, 6, CV_16UC1, cv::Scalar(0));
    frame.mask(cv::Rect(0, 0, 2, 2)).setTo(5);
    ASSERT_TRUE(evaluator.Observe(frame).has_value());
  }
  const MaskEvaluation scores = evaluator.Result(info, info.objects, MatchMode::kNames).value();
  EXPECT_EQ(scores.images, 2);
  EXPECT_EQ(scores.mean_iou.value, 1.0);
  ASSERT_EQ(scores.remarks.size(), 1U);
  EXPECT_NE(scores.remarks[0].find("1 images, '3.jpg' among them, do not hold ids exactly"),
            std::string::npos)
      << scores.remarks[0];
}

// Each id gets a mask of its box: ids that lie all over the image would take memory without bound.
TEST_F(MaskFolderTest, BoxesAreAsLargeTogetherAsAnImageMayBe) {
  constexpr int kSide_px = 400;
  constexpr int kIds = 1000;  // of 160 pixels each, whose boxes are nearly the image
  cv::Mat ids(kSide_px, kSide_px, CV_16UC1);
  cv::RNG(1).fill(ids, cv::RNG::UNIFORM, 1, 1 + kIds);
  ASSERT_TRUE(cv::imwrite((folder_ / "1.png").string(), ids));
  Frame frame = FrameNumber(1);
  frame.depth = cv::Mat(kSide_px, kSide_px, CV_32FC1, cv::Scalar(1));
  const auto found = MaskFolder::Open(folder_.path()).value()->Find(frame);
  ASSERT_FALSE(found.has_value());
  EXPECT_EQ(found.error().kind, ErrorKind::kData);
  EXPECT_NE(found.error().message.find("frame 1: "), std::string::npos) << found.error().message;
  EXPECT_NE(found.error().message.find("image_pixels"), std::string::npos) << found.error().message;
}

}  // namespace
}  // namespace tsdfpp
