// `--track`, `--track-config` and `--mask-repair-config` of compare: that they reach the maps, and
// what they refuse.
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

class CompareTracking : public testing::Test {
 protected:
  CommandOutput Run(const std::vector<std::string>& more, const std::string& until) {
    std::vector<std::string> arguments{"compare",    scene_,  "--methods", "tsdf++/anchored",
                                       "--profiles", "close", "--until",   until,
                                       "--out",      Out()};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return test::RunTsdfpp(arguments, folder_.path());
  }
  // The one map of its summary.
  nlohmann::json Compared(const std::vector<std::string>& more, const std::string& until) {
    const CommandOutput run = Run(more, until);
    EXPECT_EQ(run.exit_code, 0) << run.err;
    const auto summary = nlohmann::json::parse(std::ifstream(Out() / "summary.json"));
    command_ = summary["command"];
    return summary["runs"][0];
  }
  void ExpectRefused(const std::vector<std::string>& more, const std::string& sentence) {
    const CommandOutput run = Run(more, "1");
    EXPECT_EQ(run.exit_code, kUsage);
    EXPECT_NE(run.err.find(sentence), std::string::npos) << run.err;
    EXPECT_FALSE(fs::exists(Out()));
  }
  fs::path Out() const { return folder_ / "out"; }
  fs::path Settings(const std::string& text) const {
    std::ofstream(folder_ / "settings.toml") << text;
    return folder_ / "settings.toml";
  }
  std::string scene_ = TSDFPP_SOURCE_DIR "/scenes/mini.toml";
  std::string command_;
  test::TempFolder folder_;
};

// A gate that lets no motion pass leaves the car where it began.
TEST_F(CompareTracking, SettingsReachTheTracker) {
  const auto off_m = [&](const std::string& settings) {
    const auto run = Compared({"--poses", "track", "--track-config", Settings(settings)}, "20");
    EXPECT_NE(command_.find(" --track-config "), std::string::npos) << command_;
    return run["trajectories"]["1"]["ate_rmse_m"].get<double>();
  };
  constexpr double kVoxel_m = 0.01;
  EXPECT_LT(off_m(""), kVoxel_m);
  EXPECT_GT(off_m("max_translation_voxels = 1e-6"), 3 * kVoxel_m);
}

// This scene's experiment removes nothing; its duck starts at frame 15, and nothing else moves.
TEST_F(CompareTracking, ScoresWhatMovesWithoutBeingRemoved) {
  scene_ = TSDFPP_SOURCE_DIR "/scenes/occlusion.toml";
  const auto run = Compared({"--poses", "track"}, "18");
  ASSERT_EQ(run["trajectories"].size(), 1U);
  EXPECT_EQ(run["trajectories"]["2"]["frames"], 18);
}

TEST_F(CompareTracking, SaysWhatIsTracked) {
  EXPECT_EQ(Compared({"--poses", "track", "--track", "moving"}, "2")["tracked"], "moving");
  EXPECT_NE(command_.find(" --track moving"), std::string::npos) << command_;
  EXPECT_EQ(Compared({"--poses", "icp", "--track", "all"}, "2")["tracked"], "all");
  EXPECT_TRUE(Compared({}, "1")["tracked"].is_null());
  EXPECT_EQ(command_.find("--track"), std::string::npos) << command_;
}

TEST_F(CompareTracking, TheCommandHasWhatIsKept) {
  const auto ends = [&](const std::vector<std::string>& more, const std::string& words) {
    Compared(more, "1");
    EXPECT_TRUE(command_.ends_with(" --until 1" + words)) << command_;
  };
  ends({}, "");
  ends({"--record"}, " --record");
  ends({"--record", "--keep-meshes"}, " --keep-meshes --record");
}

// One frame is enough to confirm a label where the settings say so.
TEST_F(CompareTracking, SettingsReachTheRepair) {
  EXPECT_EQ(Compared({"--mask-repair", "on"}, "1")["map"]["blocks"], 0);
  const auto at_once = Compared(
      {"--mask-repair", "on", "--mask-repair-config", Settings("confirm_frames = 1")}, "1");
  EXPECT_GT(at_once["map"]["blocks"], 0);
  EXPECT_NE(command_.find(" --mask-repair-config "), std::string::npos) << command_;
}

TEST_F(CompareTracking, IsRefusedWhereNothingIsTracked) {
  ExpectRefused({"--poses", "gt", "--track", "all"}, "--track all needs --poses icp or track");
  ExpectRefused({"--poses", "gt,icp", "--track-config", Settings("")},
                "--track-config needs --poses track, or --camera refine or track");
  ExpectRefused({"--poses", "track", "--track-config", Settings("huber_voxel = 1")}, "huber_voxel");
  ExpectRefused({"--mask-repair-config", Settings("")},
                "--mask-repair-config needs --mask-repair on");
}

}  // namespace
}  // namespace tsdfpp
