// `--segmentation` of compare: our maps from depth alone, scored by the sequence's masks.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/cli/run_command.h"
#include "tests/core/temp_folder.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;
using test::CommandOutput;
using test::kUsage;

const std::string kScene = TSDFPP_SOURCE_DIR "/scenes/stack.toml";

class CompareSegmentation : public testing::Test {
 protected:
  CommandOutput Run(const std::vector<std::string>& options) {
    std::vector<std::string> arguments{"compare",    kScene,  "--methods", "tsdf++/anchored",
                                       "--profiles", "close", "--until",   "12",
                                       "--every",    "12",    "--out",     folder_ / "out"};
    arguments.insert(arguments.end(), options.begin(), options.end());
    return test::RunTsdfpp(arguments, folder_.path());
  }
  nlohmann::json Summary() const {
    return nlohmann::json::parse(std::ifstream(folder_ / "out/summary.json"));
  }
  fs::path Settings(const std::string& text) const {
    std::ofstream(folder_ / "segments.toml") << text;
    return folder_ / "segments.toml";
  }
  test::TempFolder folder_;
};

TEST_F(CompareSegmentation, OfDepthIsScoredByTheSequencesMasks) {
  const CommandOutput run =
      Run({"--segmentation", "depth", "--segmentation-config", Settings("noise = \"exact\"")});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const nlohmann::json summary = Summary();
  const nlohmann::json& map = summary["runs"][0];
  EXPECT_EQ(map["segmentation"], "depth");
  EXPECT_EQ(map["associate"], "votes");
  EXPECT_EQ(map["poses"], "track");
  // Some true object is one of the map's.
  int matched = 0;
  for (const auto& id : map["matched_ids"]) matched += id["object"].is_null() ? 0 : 1;
  EXPECT_GT(matched, 0) << map["matched_ids"].dump();
  EXPECT_GT(map["evaluations"].back()["visible_completion"], 0.5);
  EXPECT_NE(summary["command"].get<std::string>().find("--segmentation depth"), std::string::npos);
}

TEST_F(CompareSegmentation, IsOfTheSequenceUnlessItIsSaid) {
  ASSERT_EQ(Run({}).exit_code, 0);
  EXPECT_EQ(Summary()["runs"][0]["segmentation"], "gt");
  ASSERT_EQ(Run({"--segmentation", "none"}).exit_code, 0);
  EXPECT_EQ(Summary()["runs"][0]["segmentation"], "none");
}

// Pixels alone: our own network joined with depth (paper III-B).
TEST_F(CompareSegmentation, OfANetworkAndDepthIsScoredToo) {
  const CommandOutput run = Run({"--segmentation", "full"});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const nlohmann::json summary = Summary();
  EXPECT_EQ(summary["runs"][0]["segmentation"], "full");
  EXPECT_NE(summary["command"].get<std::string>().find("--segmentation full"), std::string::npos);
}

TEST_F(CompareSegmentation, RefusesWhatDoesNotGoTogether) {
  const auto refuses = [&](const std::vector<std::string>& options, const std::string& sentence) {
    const CommandOutput run = Run(options);
    EXPECT_EQ(run.exit_code, kUsage);
    EXPECT_NE(run.err.find(sentence), std::string::npos) << run.err;
    EXPECT_FALSE(fs::exists(folder_ / "out/summary.json"));
  };
  refuses({"--segmentation", "depth", "--associate", "given"},
          "the ids of --segmentation depth are drawn anew in every frame");
  refuses({"--segmentation", "depth", "--poses", "gt"}, "given poses are those of given ids");
  refuses({"--segmentation-config", Settings("")},
          "--segmentation-config needs --segmentation depth or full");
  refuses({"--segmentation", "depth", "--segmentation-config", Settings("sigmas = -1")}, "sigmas");
}

}  // namespace
}  // namespace tsdfpp
