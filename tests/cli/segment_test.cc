// `tsdfpp segment`: what it writes, and what it refuses.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <set>

#include "core/files.h"
#include "core/types.h"
#include "sequence/export.h"
#include "tests/cli/run_command.h"
#include "tests/core/temp_folder.h"
#include "tests/sequence/box_source.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;
using test::CommandOutput;
using test::kData;
using test::kUsage;

const std::string kScene = TSDFPP_SOURCE_DIR "/scenes/mini.toml";
const std::string kNetwork = TSDFPP_SOURCE_DIR "/tests/data/networks/centres.onnx";

class SegmentCommand : public testing::Test {
 protected:
  // A TUM set of 4 frames with masks.
  fs::path Recording() {
    test::BoxSource source(4);
    if (!fs::exists(folder_ / "boxes")) {
      EXPECT_TRUE(ExportSequence(source, DatasetFormat::kTum, folder_ / "boxes").has_value());
    }
    return folder_ / "boxes";
  }
  CommandOutput Run(const std::vector<std::string>& more, const fs::path& sequence) {
    std::vector<std::string> arguments{"segment", sequence, "--out", folder_ / "out"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return test::RunTsdfpp(arguments, folder_.path());
  }
  test::TempFolder folder_;
};

TEST_F(SegmentCommand, WritesTheGivenMasksAsSixteenBits) {
  const fs::path recording = Recording();
  const CommandOutput run = Run({"--segmentation", "gt", "--score", "--json"}, recording);
  ASSERT_EQ(run.exit_code, 0) << run.err;
  test::BoxSource source(4);
  for (int i = 0; i < 4; ++i) {
    const cv::Mat ids =
        cv::imread((folder_ / fmt::format("out/{:06d}.png", i)).string(), cv::IMREAD_UNCHANGED);
    ASSERT_EQ(ids.type(), CV_16UC1) << i;
    const Frame frame = source.Read(source.info().first_index + i).value();
    EXPECT_EQ(cv::countNonZero(ids != frame.mask), 0) << i;
  }
  const auto json = nlohmann::json::parse(run.out);
  EXPECT_EQ(json["frames"], 4);
  EXPECT_EQ(json["scores"]["all"]["pq"], 1.0);
  EXPECT_EQ(json, nlohmann::json::parse(std::ifstream(folder_ / "out/segments.json")));
}

TEST_F(SegmentCommand, DepthLeavesSegmentsPicturesAndNoOtherRunsFiles) {
  const fs::path recording = Recording();
  ASSERT_EQ(Run({}, recording).exit_code, 0);
  EXPECT_TRUE(fs::exists(folder_ / "out/000003.png"));
  const CommandOutput run = Run({"--every", "3", "--colour", "--noise", "exact"}, recording);
  ASSERT_EQ(run.exit_code, 0) << run.err;
  std::set<std::string> names;
  for (const auto& entry : fs::directory_iterator(folder_ / "out")) {
    names.insert(entry.path().filename().string());
  }
  EXPECT_EQ(names, (std::set<std::string>{"000000.png", "000003.png", "colour", "run.json",
                                          "segments.json"}));
  EXPECT_EQ(cv::imread((folder_ / "out/colour/000003.png").string(), cv::IMREAD_UNCHANGED).type(),
            CV_8UC3);
}

// The network says "thing" where it is red; joined, surfaces of depth that are mostly red are one.
// The network of the tests calls red a thing: here object 3 of the first frame. Depth has segments
// of both objects, of which the network knows one.
TEST_F(SegmentCommand, ANetworkAloneAndJoined) {
  const fs::path recording = Recording();
  const Frame frame = test::BoxSource(4).Read(0).value();
  const cv::Mat is_thing = frame.mask == 3;
  cv::Mat painted(frame.mask.size(), CV_8UC3, cv::Scalar(0, 0, 0));
  painted.setTo(cv::Scalar(128, 0, 255), is_thing);
  const cv::Rect box = cv::boundingRect(is_thing);
  const cv::Point centre = (box.tl() + box.br()) / 2;
  painted.at<cv::Vec3b>(centre)[1] = 255;
  const std::set<fs::path> pictures(fs::directory_iterator(recording / "rgb"), {});
  ASSERT_TRUE(cv::imwrite(pictures.begin()->string(), painted));

  const auto ids_of = [&](const std::string& way, const std::string& settings) {
    EXPECT_TRUE(WriteFile(folder_ / "network.toml", settings).has_value());
    const CommandOutput run = Run({"--segmentation", way, "--model", kNetwork, "--network-config",
                                   folder_ / "network.toml", "--score", "--json"},
                                  recording);
    EXPECT_EQ(run.exit_code, 0) << run.err;
    EXPECT_EQ(run.err.find("ERROR"), std::string::npos) << run.err;
    EXPECT_EQ(nlohmann::json::parse(run.out).at("segmentation"), way);
    return cv::imread((folder_ / "out/000000.png").string(), cv::IMREAD_UNCHANGED);
  };
  const std::string width = fmt::format("width = {}\n", frame.mask.cols);
  EXPECT_EQ(cv::countNonZero((ids_of("network", width) == 1) != is_thing), 0);
  const cv::Mat joined = ids_of("full", width);
  ASSERT_EQ(joined.type(), CV_16UC1);
  const auto share_of = [&](const cv::Mat& ids, int object) {
    const cv::Mat there = frame.mask == object;
    return static_cast<double>(cv::countNonZero((ids != 0) & (ids != kNoInstance) & there)) /
           cv::countNonZero(there);
  };
  EXPECT_GT(share_of(joined, 3), 0.8);
  EXPECT_EQ(share_of(joined, 8), 0) << "no network knows it";
  const cv::Mat all = ids_of("full", width + "unknown_objects = true\n");
  EXPECT_GT(share_of(all, 3), 0.8);
  EXPECT_GT(share_of(all, 8), 0.8);
}

// Of a scene: another sensor and another seed are other images, and so other segments.
TEST_F(SegmentCommand, SensorAndSeedOfAScene) {
  std::set<std::string> images;
  const std::vector<std::vector<std::string>> ways{{},
                                                   {"--sensor", "nguyen2012"},
                                                   {"--sensor", "nguyen2012", "--seed", "7"},
                                                   {"--sensor", "nguyen2012", "--seed", "7"}};
  for (const auto& way : ways) {
    std::vector<std::string> more{"--every", "1000"};
    more.insert(more.end(), way.begin(), way.end());
    const CommandOutput run = Run(more, kScene);
    ASSERT_EQ(run.exit_code, 0) << run.err;
    images.insert(ReadFile(folder_ / "out/000001.png").value());
  }
  EXPECT_EQ(images.size(), 3U) << "and the same once more is the same";
}

// What one run wrote is another's masks, under other ids.
TEST_F(SegmentCommand, MasksOfAFolder) {
  const fs::path recording = Recording();
  ASSERT_EQ(Run({"--segmentation", "gt"}, recording).exit_code, 0);
  fs::rename(folder_ / "out", folder_ / "masks");
  const CommandOutput run = Run(
      {"--segmentation", "network", "--masks", folder_ / "masks", "--score", "--json"}, recording);
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_EQ(nlohmann::json::parse(run.out)["scores"]["all"]["pq"], 1.0);
  const cv::Mat ids = cv::imread((folder_ / "out/000000.png").string(), cv::IMREAD_UNCHANGED);
  const Frame frame = test::BoxSource(4).Read(0).value();
  EXPECT_EQ(cv::countNonZero((ids == 1) != (frame.mask == 3)), 0);
  EXPECT_EQ(cv::countNonZero((ids == 2) != (frame.mask == 8)), 0);
  constexpr const char* kNothing = "no frame has a segment beside the background";
  EXPECT_EQ(run.err.find(kNothing), std::string::npos);
  // A network may say the same of every frame, and ends as one that found all.
  for (int i = 0; i < 4; ++i) {
    const std::string mask = (folder_ / fmt::format("masks/{:06d}.png", i)).string();
    ASSERT_TRUE(cv::imwrite(mask, cv::Mat(frame.mask.size(), CV_16UC1, cv::Scalar(0))));
  }
  const CommandOutput none =
      Run({"--segmentation", "network", "--masks", folder_ / "masks"}, recording);
  EXPECT_EQ(none.exit_code, 0) << none.err;
  EXPECT_NE(none.err.find(kNothing), std::string::npos) << none.err;
}

// Our own network, every second frame: between them there are no segments.
TEST_F(SegmentCommand, OurOwnNetworkIsPartOfTheProgram) {
  const fs::path recording = Recording();
  ASSERT_TRUE(WriteFile(folder_ / "network.toml", "every = 2\n").has_value());
  const CommandOutput run =
      Run({"--segmentation", "network", "--network-config", folder_ / "network.toml"}, recording);
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const auto image = [&](const char* name) {
    return cv::imread((folder_ / "out" / name).string(), cv::IMREAD_UNCHANGED);
  };
  EXPECT_EQ(cv::countNonZero(image("000000.png") == kNoInstance), 0);
  EXPECT_EQ(cv::countNonZero(image("000001.png") != kNoInstance), 0);
}

TEST_F(SegmentCommand, KernelsChangeNoByte) {
  const fs::path recording = Recording();
  std::map<std::string, std::vector<std::string>> images;
  for (const std::string kernels : {"simd", "plain"}) {
    const CommandOutput run = Run({"--kernels", kernels, "--json"}, recording);
    ASSERT_EQ(run.exit_code, 0) << run.err;
    EXPECT_EQ(nlohmann::json::parse(run.out).at("kernels"), kernels);
    for (int i = 0; i < 4; ++i) {
      images[kernels].push_back(ReadFile(folder_ / fmt::format("out/{:06d}.png", i)).value());
    }
  }
  EXPECT_TRUE(images["plain"] == images["simd"]);
}

TEST_F(SegmentCommand, RefusesWithOneSentence) {
  const fs::path recording = Recording();
  const auto refused = [&](const std::vector<std::string>& more, int code, const char* words,
                           const fs::path& sequence) {
    const CommandOutput run = Run(more, sequence);
    EXPECT_EQ(run.exit_code, code) << words;
    EXPECT_NE(run.err.find(words), std::string::npos) << run.err;
    EXPECT_FALSE(fs::exists(folder_ / "out/run.json"));
  };
  refused({"--segmentation", "gt", "--noise", "exact"}, kUsage,
          "--noise goes with --segmentation depth or full only", recording);
  refused({"--noise", "kinect"}, kUsage, "expected one of nguyen2012, exact", recording);
  refused({"--model", kNetwork}, kUsage, "--model needs --segmentation network or full", recording);
  refused({"--masks", folder_.path()}, kUsage, "--masks needs --segmentation network or full",
          recording);
  refused({"--segmentation", "full", "--masks", recording / "rgb", "--model", kNetwork}, kUsage,
          "--masks and --model are both given", recording);
  refused({"--segmentation", "full", "--masks", folder_ / "no"}, kData, "no", recording);
  refused({"--segmentation", "network", "--model", folder_ / "none.onnx"}, kData,
          "none.onnx: there is no such file", recording);
  ASSERT_TRUE(WriteFile(folder_ / "network.toml", "every = 0\n").has_value());
  refused({"--segmentation", "full", "--network-config", folder_ / "network.toml"}, kUsage,
          "'every' is 0, expected 1 to 1000", recording);
  ASSERT_TRUE(WriteFile(folder_ / "network.toml", "width = 64\n").has_value());
  refused({"--segmentation", "full", "--masks", recording / "rgb", "--network-config",
           folder_ / "network.toml"},
          kUsage, "'width' is a setting of networks, expected with --masks: every, latency",
          recording);
  ASSERT_TRUE(WriteFile(folder_ / "network.toml", "every = 3\nlatency = 2\n").has_value());
  refused({"--segmentation", "network", "--network-config", folder_ / "network.toml"}, kUsage,
          "'latency' is a setting of --segmentation full", recording);
  refused({"--sensor", "nguyen2012"}, kUsage, "is a sequence; a sensor and a seed are for scenes",
          recording);
  refused({"--seed", "3"}, kUsage, "is a sequence; a sensor and a seed are for scenes", recording);
  refused({"--sensor", "none_such"}, kUsage, "none_such", kScene);
  ASSERT_TRUE(WriteFile(folder_ / "bad.toml", "sigmas = 0.0\n").has_value());
  refused({"--settings", folder_ / "bad.toml"}, kUsage, "'sigmas' is 0", recording);
  const fs::path unmasked = folder_ / "unmasked";
  fs::copy(recording, unmasked, fs::copy_options::recursive);
  fs::remove_all(unmasked / "mask");
  refused({"--segmentation", "gt"}, kData, "has no mask", unmasked);
  refused({"--score"}, kData, "for --score", unmasked);
  EXPECT_EQ(Run({}, unmasked).exit_code, 0);
}

// Ids have the names that images of data sets have.
TEST_F(SegmentCommand, WhatIsReadIsNotWrittenOver) {
  const fs::path recording = Recording();
  const auto refused = [&](const fs::path& out, const std::vector<std::string>& more,
                           const char* words) {
    std::vector<std::string> arguments{"segment", recording, "--out", out};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const CommandOutput run = test::RunTsdfpp(arguments, folder_.path());
    EXPECT_EQ(run.exit_code, kUsage) << out;
    EXPECT_NE(run.err.find(words), std::string::npos) << run.err;
  };
  refused(recording, {}, "which is read, expected a folder outside");
  refused(recording / "depth", {}, "which is read, expected a folder outside");
  refused(recording / "new/one", {}, "which is read, expected a folder outside");
  fs::create_directory_symlink(recording / "depth", folder_ / "link");
  refused(folder_ / "link", {}, "which is read, expected a folder outside");
  ASSERT_EQ(Run({"--segmentation", "gt"}, recording).exit_code, 0);
  fs::rename(folder_ / "out", folder_ / "masks");
  refused(folder_ / "masks", {"--segmentation", "network", "--masks", folder_ / "masks"},
          "which is read, expected a folder outside");
  // What somebody else put there.
  fs::create_directories(folder_ / "theirs/colour");
  ASSERT_TRUE(WriteFile(folder_ / "theirs/colour/000002.png", "x").has_value());
  refused(folder_ / "theirs", {"--colour"}, "000002.png: is of no earlier run");
  EXPECT_EQ(ReadFile(folder_ / "theirs/colour/000002.png").value(), "x");
  fs::rename(folder_ / "masks", folder_ / "out");
  EXPECT_EQ(Run({"--segmentation", "gt"}, recording).exit_code, 0) << "an earlier run's own";
}

}  // namespace
}  // namespace tsdfpp
