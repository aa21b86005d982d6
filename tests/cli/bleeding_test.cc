// `--bleeding` of map and compare: what it says of itself, and what it refuses.
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

const std::string kScene = TSDFPP_SOURCE_DIR "/scenes/mini.toml";

class BleedingCommand : public testing::Test {
 protected:
  CommandOutput Run(std::vector<std::string> arguments) {
    arguments.insert(arguments.end(), {"--out", Out()});
    return test::RunTsdfpp(arguments, folder_.path());
  }
  fs::path Out() const { return folder_ / "out"; }
  // What map's statistics say became of the pixels.
  std::string Became(const std::vector<std::string>& options) {
    std::vector<std::string> arguments{"map", kScene, "--until", "1"};
    arguments.insert(arguments.end(), options.begin(), options.end());
    const CommandOutput run = Run(arguments);
    EXPECT_EQ(run.exit_code, 0) << run.err;
    return nlohmann::json::parse(std::ifstream(Out() / "stats.json"))["bleeding"];
  }
  test::TempFolder folder_;
};

TEST_F(BleedingCommand, IsWhatTheTrackingAsksForUnlessItIsSaid) {
  EXPECT_EQ(Became({}), "keep");
  EXPECT_EQ(Became({"--poses", "track"}), "wait");
  EXPECT_EQ(Became({"--camera", "refine"}), "wait");
  EXPECT_EQ(Became({"--bleeding", "wait"}), "wait");
  EXPECT_EQ(Became({"--poses", "track", "--bleeding", "keep"}), "keep");
}

TEST_F(BleedingCommand, CompareSaysItPerRun) {
  const CommandOutput run = Run({"compare", kScene, "--methods", "volumes", "--profiles", "close",
                                 "--until", "1", "--bleeding", "wait"});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const auto summary = nlohmann::json::parse(std::ifstream(Out() / "summary.json"));
  EXPECT_EQ(summary["runs"][0]["bleeding"], "wait");
  EXPECT_NE(summary["command"].get<std::string>().find("--bleeding wait"), std::string::npos);
}

TEST_F(BleedingCommand, IsRefusedWhereItIsNoneOrThereIsNothingToMap) {
  const CommandOutput unknown = Run({"map", kScene, "--bleeding", "drop"});
  EXPECT_EQ(unknown.exit_code, kUsage);
  EXPECT_NE(unknown.err.find("--bleeding"), std::string::npos) << unknown.err;
  const fs::path saved = folder_ / "saved.map";
  ASSERT_EQ(Run({"map", kScene, "--until", "1", "--save", saved}).exit_code, 0);
  fs::remove_all(Out());
  const CommandOutput no_frames = Run({"map", "--load", saved, "--bleeding", "wait"});
  EXPECT_EQ(no_frames.exit_code, kUsage);
  EXPECT_NE(no_frames.err.find("--bleeding wait needs a sequence"), std::string::npos)
      << no_frames.err;
  EXPECT_FALSE(fs::exists(Out()));
}

}  // namespace
}  // namespace tsdfpp
