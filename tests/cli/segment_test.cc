// `tsdfpp segment`: what it writes, and what it refuses.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
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
          "--noise goes with --segmentation depth only", recording);
  refused({"--noise", "kinect"}, kUsage, "expected one of nguyen2012, exact", recording);
  ASSERT_TRUE(WriteFile(folder_ / "bad.toml", "sigmas = 0.0\n").has_value());
  refused({"--settings", folder_ / "bad.toml"}, kUsage, "'sigmas' is 0", recording);
  const fs::path unmasked = folder_ / "unmasked";
  fs::copy(recording, unmasked, fs::copy_options::recursive);
  fs::remove_all(unmasked / "mask");
  refused({"--segmentation", "gt"}, kData, "has no mask", unmasked);
  refused({"--score"}, kData, "for --score", unmasked);
  EXPECT_EQ(Run({}, unmasked).exit_code, 0);
}

}  // namespace
}  // namespace tsdfpp
