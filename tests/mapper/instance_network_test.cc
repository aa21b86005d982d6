// Networks read from files as users have them (tests/data/networks/make_networks.py), whose outputs
// can be told from their pictures.
#include "mapper/instance_network.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <fstream>
#include <functional>
#include <string>

#include "mapper/network/coco_classes.h"
#include "mapper/network/yolo_masks.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;

fs::path NetworkFile(const std::string& name) {
  return fs::path(TSDFPP_SOURCE_DIR) / "tests/data/networks" / name;
}

Frame FrameOf(int width, int height, const std::function<cv::Vec3b(int, int)>& colour) {
  Frame frame;
  frame.index = 7;
  frame.intrinsics = {width, height, 100, 100, width / 2.0, height / 2.0};
  frame.depth = cv::Mat(height, width, CV_32FC1, cv::Scalar(1));
  frame.colour = cv::Mat(height, width, CV_8UC3);
  for (int v = 0; v < height; ++v) {
    for (int u = 0; u < width; ++u) frame.colour.at<cv::Vec3b>(v, u) = colour(v, u);
  }
  return frame;
}

std::string ErrorOf(const fs::path& file, const NetworkConfig& config = {}) {
  const auto loaded = LoadInstanceNetwork(file, config);
  return loaded ? "" : loaded.error().message;
}

// The image's pixels of an instance.
cv::Mat WholeMask(const Instance& instance, cv::Size size) {
  cv::Mat whole(size, CV_8UC1, cv::Scalar(0));
  instance.mask.copyTo(whole(instance.box));
  return whole;
}

// Where it is drawn is where it is read: half a pixel beside, a mask is half a pixel off.
TEST(Letterbox, LiesOnWholePixels) {
  const Letterbox exact = LetterboxOf({640, 427}, {640, 640});
  EXPECT_EQ(exact.place, cv::Rect(0, 107, 640, 427));
  EXPECT_EQ(exact.scale_y(), 1.0);
  const Letterbox rounded = LetterboxOf({64, 31}, {32, 32});
  EXPECT_EQ(rounded.place, cv::Rect(0, 8, 32, 16));
  EXPECT_EQ(rounded.scale_x(), 0.5);
  EXPECT_EQ(rounded.scale_y(), 16.0 / 31);
}

// Red is a thing, green its centre, blue and depth the way there.
TEST(InstanceNetwork, CentresAreFoundWhereTheColoursSay) {
  NetworkConfig config;
  config.width = 32;
  const auto finder = LoadInstanceNetwork(NetworkFile("centres.onnx"), config).value();
  // Two things of one patch of red: the left half points to (6, 4), the right one to (20, 4).
  constexpr int kScale = 2;  // of the image to the input
  const auto frame = FrameOf(32 * kScale, 20 * kScale, [](int v, int u) -> cv::Vec3b {
    u /= kScale;
    v /= kScale;
    const bool is_thing = u >= 2 && u < 26 && v >= 2 && v < 8;
    if (!is_thing) return {0, 0, 128};
    const int centre = u < 13 ? 6 : 20;
    const bool is_centre = v == 4 && u == centre;
    const int way = static_cast<int>(std::lround((centre - u) * 255.0 / 32 + 127.5));
    return {255, static_cast<std::uint8_t>(is_centre ? 255 : 0), static_cast<std::uint8_t>(way)};
  });
  const auto found = finder->Find(frame).value();
  ASSERT_EQ(found.size(), 2U);
  EXPECT_EQ(found[0].box, cv::Rect(2 * kScale, 2 * kScale, 11 * kScale, 6 * kScale));
  EXPECT_EQ(found[1].box, cv::Rect(13 * kScale, 2 * kScale, 13 * kScale, 6 * kScale));
  for (const Instance& instance : found) {
    EXPECT_EQ(cv::countNonZero(instance.mask), instance.box.area());
    EXPECT_EQ(instance.semantic_class, "thing");
    EXPECT_NEAR(instance.score, 1, 1e-3);
  }
}

// The way in rows comes by depth: of two rows of things the far one points down, the near one up.
TEST(InstanceNetwork, CentresReadDepth) {
  NetworkConfig config;
  config.width = 32;
  const auto finder = LoadInstanceNetwork(NetworkFile("centres.onnx"), config).value();
  auto frame = FrameOf(32, 32, [](int v, int u) -> cv::Vec3b {
    const bool is_centre = u == 16 && (v == 6 || v == 26);
    return {255, static_cast<std::uint8_t>(is_centre ? 255 : 0), 128};
  });
  // Rows 0 to 9 belong to the centre at 26, the others to that at 6.
  for (int v = 0; v < 32; ++v) {
    const int to = v < 10 ? 26 : 6;
    frame.depth.row(v).setTo(1 / (1 + (to - v) / 32.0));
  }
  const auto found = finder->Find(frame).value();
  ASSERT_EQ(found.size(), 2U);
  EXPECT_EQ(found[0].box, cv::Rect(0, 10, 32, 22));
  EXPECT_EQ(found[1].box, cv::Rect(0, 0, 32, 10));
}

// Boxes of make_networks.py, on a picture twice as wide as high: the input of 64 x 64 has 16 rows
// of grey above and below it, which are not red to the network (114 of 255).
void ExpectYolo(const std::string& file) {
  NetworkConfig config;
  config.width = 64;
  config.height = 64;
  config.classes = {"cup", "car"};
  config.most_overlap = 0.5;
  const auto finder = LoadInstanceNetwork(NetworkFile(file), config).value();
  // The left half is red.
  const auto frame = FrameOf(128, 64, [](int, int u) -> cv::Vec3b {
    return u < 64 ? cv::Vec3b(255, 0, 0) : cv::Vec3b(0, 0, 255);
  });
  const auto found = finder->Find(frame).value();
  ASSERT_EQ(found.size(), 3U) << file;
  // (4, 20) to (28, 44) of the input, of which a pixel is two of the image; the second box is it
  // again, the fourth has no pixel above the threshold.
  EXPECT_EQ(found[0].box, cv::Rect(8, 8, 48, 48));
  EXPECT_EQ(found[0].semantic_class, "cup");
  EXPECT_NEAR(found[0].score, 0.9, 1e-6);
  EXPECT_EQ(cv::countNonZero(found[0].mask), 48 * 48);
  EXPECT_EQ(found[1].box, cv::Rect(10, 8, 48, 48));
  EXPECT_EQ(found[1].semantic_class, "car");
  EXPECT_EQ(found[2].box, cv::Rect(80, 12, 32, 40));
  EXPECT_EQ(found[2].semantic_class, "car");
  EXPECT_EQ(cv::countNonZero(found[2].mask), 32 * 40);
  // With a lower threshold, and repeats kept, there are the first one's repeat and the last.
  config.least_score = 0.25;
  config.most_overlap = 1;
  EXPECT_EQ(LoadInstanceNetwork(NetworkFile(file), config).value()->Find(frame).value().size(), 5U);
  // Blue before red: there is no red where the first box is.
  const auto blue = FrameOf(128, 64, [](int, int) { return cv::Vec3b(0, 0, 255); });
  EXPECT_EQ(finder->Find(blue).value().size(), 2U);
}

TEST(InstanceNetwork, YoloOfBothLayouts) {
  ExpectYolo("yolo_v8.onnx");
  ExpectYolo("yolo_v5.onnx");
}

TEST(InstanceNetwork, YoloWithOtherClassesIsRefused) {
  const auto finder =
      LoadInstanceNetwork(NetworkFile("yolo_v8.onnx"), {.width = 64, .height = 64}).value();
  const auto frame = FrameOf(64, 64, [](int, int) { return cv::Vec3b(0, 0, 0); });
  const auto found = finder->Find(frame);
  ASSERT_FALSE(found.has_value());
  EXPECT_EQ(found.error().message,
            fmt::format("frame 7: the network {}: its boxes are 1x8x6, expected 1x86xN or 1xNx87 "
                        "with 80 classes and 2 prototypes",
                        NetworkFile("yolo_v8.onnx").string()));
}

TEST(InstanceNetwork, MaskRcnnAsOpenCvHasIt) {
  const auto finder = LoadInstanceNetwork(NetworkFile("mask_rcnn.pb"), {}).value();
  const auto frame = FrameOf(80, 40, [](int, int) { return cv::Vec3b(9, 9, 9); });
  const auto found = finder->Find(frame).value();
  ASSERT_EQ(found.size(), 2U);
  EXPECT_EQ(found[0].semantic_class, "bicycle");
  EXPECT_EQ(found[0].box, cv::Rect(20, 10, 40, 10));
  EXPECT_NEAR(found[0].score, 0.9, 1e-6);
  EXPECT_EQ(cv::countNonZero(found[0].mask), 40 * 10);
  // The left half of its box.
  EXPECT_EQ(found[1].semantic_class, "car");
  EXPECT_EQ(found[1].box, cv::Rect(40, 20, 40, 20));
  const cv::Mat mask = WholeMask(found[1], {80, 40});
  EXPECT_EQ(cv::countNonZero(mask), 20 * 20);
  EXPECT_EQ(cv::countNonZero(mask(cv::Rect(40, 20, 20, 20))), 20 * 20);
}

TEST(InstanceNetwork, WhatIsNoNetworkGetsASentence) {
  EXPECT_NE(ErrorOf("/nowhere/x.onnx").find("there is no such file"), std::string::npos);
  const fs::path folder = fs::path(testing::TempDir()) / "tsdfpp-instance-network";
  fs::create_directories(folder);
  const auto write = [&](const std::string& name, const std::string& text) {
    std::ofstream(folder / name) << text;
    return folder / name;
  };
  EXPECT_NE(ErrorOf(write("x.txt", "x")).find("ending is '.txt', expected .onnx or .pb"),
            std::string::npos);
  testing::internal::CaptureStderr();
  const std::string words = ErrorOf(write("x.onnx", "nothing of the kind"));
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "") << "OpenCV's words come before ours";
  EXPECT_NE(words.find("x.onnx: OpenCV cannot read the network"), std::string::npos) << words;
  EXPECT_NE(ErrorOf(write("empty.onnx", "")).find("has 0 bytes"), std::string::npos);
  EXPECT_NE(ErrorOf(write("alone.pb", "x")).find("alone.pbtxt: there is no such file"),
            std::string::npos);
  EXPECT_NE(ErrorOf(NetworkFile("yolo_v8.onnx"), {.format = NetworkFormat::kCentres})
                .find("has 2 outputs (boxes, prototypes), expected 1 for format centres"),
            std::string::npos);
  EXPECT_NE(ErrorOf(NetworkFile("yolo_v8.onnx"), {.format = NetworkFormat::kMaskRcnn})
                .find("format mask_rcnn is that of a .pb"),
            std::string::npos);
  fs::remove_all(folder);
}

TEST(InstanceNetwork, FramesWithoutColourAreRefused) {
  const auto finder = LoadInstanceNetwork(NetworkFile("centres.onnx"), {}).value();
  Frame frame = FrameOf(64, 32, [](int, int) { return cv::Vec3b(0, 0, 0); });
  frame.colour = cv::Mat();
  EXPECT_EQ(finder->Find(frame).error().message,
            "frame 7 has no colour of the size of its depth, which a network needs");
}

TEST(CocoClasses, AreThoseOfTheirNumbers) {
  EXPECT_EQ(CocoClasses80().size(), 80U);
  EXPECT_EQ(CocoClasses90().size(), 90U);
  // COCO's own numbers less one, of its annotations.
  EXPECT_EQ(CocoClasses90()[0], "person");
  EXPECT_EQ(CocoClasses90()[46], "cup");
  EXPECT_EQ(CocoClasses90()[83], "book");
  EXPECT_EQ(CocoClasses90()[89], "toothbrush");
  EXPECT_EQ(CocoClasses90()[82], "class 82");
  EXPECT_EQ(CocoClasses80()[73], "book");
}

// Our own network, on a picture of nothing: it runs, for images of any shape, and says the same
// whatever the number of threads.
TEST(OwnInstanceNetwork, RunsOnAnyShapeAndNumberOfThreads) {
  const auto finder = OwnInstanceNetwork({}).value();
  for (const cv::Size size : {cv::Size(64, 48), cv::Size(333, 217), cv::Size(40, 300)}) {
    const auto frame = FrameOf(size.width, size.height, [](int v, int u) {
      return cv::Vec3b(static_cast<std::uint8_t>(u), static_cast<std::uint8_t>(3 * v),
                       static_cast<std::uint8_t>(u * v));
    });
    const auto of_all = finder->Find(frame).value();
    const int threads = cv::getNumThreads();
    cv::setNumThreads(1);
    const auto of_one = finder->Find(frame).value();
    cv::setNumThreads(threads);
    ASSERT_EQ(of_all.size(), of_one.size());
    for (std::size_t i = 0; i < of_all.size(); ++i) {
      EXPECT_EQ(of_all[i].box, of_one[i].box);
      EXPECT_EQ(of_all[i].score, of_one[i].score);
      EXPECT_EQ(cv::countNonZero(of_all[i].mask != of_one[i].mask), 0);
    }
  }
}

TEST(InstanceNetwork, DepthOfAnotherTypeIsRefused) {
  const auto finder = LoadInstanceNetwork(NetworkFile("centres.onnx"), {}).value();
  Frame frame = FrameOf(64, 32, [](int, int) { return cv::Vec3b(0, 0, 0); });
  frame.depth = cv::Mat(32, 64, CV_16UC1, cv::Scalar(1000));
  EXPECT_NE(finder->Find(frame).error().message.find("expected 32-bit depths"), std::string::npos);
  frame.colour = cv::Mat(0, 5, CV_8UC3);
  frame.depth = cv::Mat(0, 5, CV_32FC1);
  EXPECT_NE(finder->Find(frame).error().message.find("has no colour"), std::string::npos);
}

// An image 2 pixels wide and 16,384 high, as high as one may be.
TEST(InstanceNetwork, ImagesOfExtremeShape) {
  const auto black = [](int, int) { return cv::Vec3b(0, 0, 0); };
  const auto own = OwnInstanceNetwork({}).value();
  EXPECT_NE(own->Find(FrameOf(2, 16384, black)).error().message.find("expected a height of 4096"),
            std::string::npos);
  const auto yolo = LoadInstanceNetwork(NetworkFile("yolo_v8.onnx"),
                                        {.classes = {"cup", "car"}, .width = 64, .height = 64})
                        .value();
  for (const auto& frame : {FrameOf(2, 16384, black), FrameOf(16384, 2, black)}) {
    EXPECT_TRUE(yolo->Find(frame).has_value());
  }
}

// A setting without effect would be taken for one that was tried.
TEST(InstanceNetwork, ASettingThatTheFormatHasNoUseForIsRefused) {
  const auto complaint = [](const auto& finder) {
    if (finder) return std::string();
    EXPECT_EQ(finder.error().kind, ErrorKind::kUsage);
    return finder.error().message;
  };
  const auto own = [&](const NetworkConfig& config) {
    return complaint(OwnInstanceNetwork(config));
  };
  EXPECT_EQ(
      own({.graph = "x.pbtxt"}),
      "network setting 'graph' is one of format mask_rcnn, and the network has format centres");
  EXPECT_EQ(own({.most_overlap = 0.6}),
            "network setting 'most_overlap' is one of format yolo, and the network has format "
            "centres");
  EXPECT_EQ(own({.mask_share = 0.6}),
            "network setting 'mask_share' is one of format yolo or mask_rcnn, and the network has "
            "format centres");
  EXPECT_EQ(own({.classes = {"cup", "car"}}),
            "network setting 'classes' has 2 names, expected one of a network of format centres");
  EXPECT_EQ(own({.classes = {"cup"}, .most_overlap = 0.45, .mask_share = 0.5}), "");
  EXPECT_NE(complaint(LoadInstanceNetwork(NetworkFile("yolo_v8.onnx"), {.graph = "x.pbtxt"})), "");
  EXPECT_NE(complaint(LoadInstanceNetwork(NetworkFile("mask_rcnn.pb"), {.most_overlap = 0.6})), "");
  EXPECT_EQ(complaint(LoadInstanceNetwork(NetworkFile("mask_rcnn.pb"), {.mask_share = 0.6})), "");
}

// A class becomes the word of an object, and a saved map's.
TEST(NetworkConfig, ClassesAreLabels) {
  for (const std::string& name : {std::string("a\0b", 3), std::string(101, 'x'), std::string()}) {
    NetworkConfig config;
    config.classes = {"cup", name};
    const auto status = config.Validate();
    ASSERT_FALSE(status.has_value());
    EXPECT_EQ(status.error().kind, ErrorKind::kUsage);
  }
  NetworkConfig config;
  config.classes = {"cup", "toy car"};
  EXPECT_TRUE(config.Validate().has_value());
}

}  // namespace
}  // namespace tsdfpp
