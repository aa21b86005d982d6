// `--mask-repair` of map, compare and sweep: what it says of itself, what it does, what it refuses.
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

class MaskRepairCommand : public testing::Test {
 protected:
  CommandOutput Run(std::vector<std::string> arguments) {
    arguments.insert(arguments.end(), {"--out", Out()});
    return test::RunTsdfpp(arguments, folder_.path());
  }
  nlohmann::json Stats() const {
    return nlohmann::json::parse(std::ifstream(Out() / "stats.json"));
  }
  void ExpectRefused(const std::vector<std::string>& arguments, const std::string& sentence) {
    const CommandOutput run = Run(arguments);
    EXPECT_EQ(run.exit_code, kUsage);
    EXPECT_NE(run.err.find(sentence), std::string::npos) << run.err;
    EXPECT_FALSE(fs::exists(Out() / "stats.json"));
    EXPECT_FALSE(fs::exists(Out() / "summary.json"));
  }
  fs::path Out() const { return folder_ / "out"; }
  fs::path Settings(const std::string& text) const {
    std::ofstream(folder_ / "repair.toml") << text;
    return folder_ / "repair.toml";
  }
  test::TempFolder folder_;
};

TEST_F(MaskRepairCommand, MapSaysWhetherItRepairs) {
  ASSERT_EQ(Run({"map", kScene, "--until", "1"}).exit_code, 0);
  EXPECT_EQ(Stats()["mask_repair"], "off");
  EXPECT_GT(Stats()["map"]["blocks"], 0);
  // Nothing is confirmed yet in the first frame ...
  const CommandOutput waits = Run({"map", kScene, "--until", "1", "--mask-repair", "on"});
  ASSERT_EQ(waits.exit_code, 0) << waits.err;
  EXPECT_EQ(Stats()["mask_repair"], "on");
  EXPECT_EQ(Stats()["map"]["blocks"], 0);
  // ... unless one frame is enough.
  const CommandOutput at_once = Run({"map", kScene, "--until", "1", "--mask-repair", "on",
                                     "--mask-repair-config", Settings("confirm_frames = 1")});
  ASSERT_EQ(at_once.exit_code, 0) << at_once.err;
  EXPECT_GT(Stats()["map"]["blocks"], 0);
}

TEST_F(MaskRepairCommand, CompareSaysItPerRun) {
  const CommandOutput run = Run({"compare", kScene, "--methods", "tsdf,volumes", "--profiles",
                                 "close", "--until", "5", "--mask-repair", "on"});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const auto summary = nlohmann::json::parse(std::ifstream(Out() / "summary.json"));
  EXPECT_EQ(summary["runs"][0]["mask_repair"], "on");
  EXPECT_EQ(summary["runs"][1]["mask_repair"], "on");
  EXPECT_NE(summary["command"].get<std::string>().find("--mask-repair on"), std::string::npos);
}

// Objects that association has held back already are not held back again.
TEST_F(MaskRepairCommand, ObjectsOfVotesAreBornOnce) {
  const auto tracked_with = [&](const std::string& mode) {
    const CommandOutput run = Run({"map", kScene, "--associate", "votes", "--mask-repair", mode});
    EXPECT_EQ(run.exit_code, 0) << run.err;
    std::vector<int> ids;
    const nlohmann::json stats = Stats();
    for (const auto& object : stats["tracking"]["objects"]) {
      EXPECT_GT(object["tracked_frames"], 0) << object.dump();
      ids.push_back(object["id"]);
    }
    return ids;
  };
  const std::vector<int> without = tracked_with("off");
  EXPECT_FALSE(without.empty());
  EXPECT_EQ(tracked_with("on"), without);
}

TEST_F(MaskRepairCommand, IsRefusedWhereItCannotBe) {
  ExpectRefused({"map", kScene, "--mask-repair", "perhaps"}, "--mask-repair");
  ExpectRefused({"map", kScene, "--mask-repair-config", Settings("")},
                "--mask-repair-config needs --mask-repair on");
  ExpectRefused({"map", kScene, "--mask-repair", "on", "--mask-repair-config",
                 Settings("confirm_frames = 0")},
                "'confirm_frames' is 0, expected 1 to 1000");
  ExpectRefused({"map", kScene, "--mask-repair", "on", "--method", "surfels"},
                "the repair of masks asks a map for its voxels, which method 'surfels' has not");
  ExpectRefused({"compare", kScene, "--mask-repair", "on", "--methods", "tsdf,surfels"},
                "the repair of masks asks a map for its voxels");
}

TEST_F(MaskRepairCommand, ALoadedMapNeedsASequenceForIt) {
  const fs::path saved = folder_ / "saved.map";
  ASSERT_EQ(Run({"map", kScene, "--until", "1", "--save", saved}).exit_code, 0);
  const CommandOutput goes_on =
      Run({"map", kScene, "--load", saved, "--until", "3", "--mask-repair", "on"});
  ASSERT_EQ(goes_on.exit_code, 0) << goes_on.err;
  EXPECT_EQ(Stats()["mask_repair"], "on");
  fs::remove_all(Out());
  ExpectRefused({"map", "--load", saved, "--mask-repair", "on"},
                "--mask-repair on needs a sequence to map");
}

}  // namespace
}  // namespace tsdfpp
