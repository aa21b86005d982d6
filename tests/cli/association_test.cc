// --associate of map and compare, on a set whose masks draw their ids anew in every frame.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <set>

#include "core/files.h"
#include "tests/cli/run_command.h"
#include "tests/core/temp_folder.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;
using test::CommandOutput;
using test::kUsage;
using test::RunTsdfpp;

class Associate : public testing::Test {
 protected:
  // scenes/mini.toml, small, with a car and a house; rendered once for all tests.
  static void SetUpTestSuite() {
    folder_ = std::make_unique<test::TempFolder>();
    const std::string scene = TSDFPP_SOURCE_DIR "/scenes/mini.toml";
    const CommandOutput made = RunTsdfpp({"generate", scene, "--sensor", "masks_redrawn",
                                          "--no-antialias", "--out", *folder_ / "redrawn"},
                                         folder_->path());
    ASSERT_EQ(made.exit_code, 0) << made.err;
  }
  static void TearDownTestSuite() { folder_.reset(); }

  static CommandOutput Run(const std::string& command, const std::string& out,
                           const std::vector<std::string>& more = {}) {
    std::vector<std::string> arguments{command, *folder_ / "redrawn", "--out", *folder_ / out};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return RunTsdfpp(arguments, folder_->path());
  }
  static fs::path Settings(const std::string& text) {
    std::ofstream(*folder_ / "settings.toml") << text;
    return *folder_ / "settings.toml";
  }
  static nlohmann::json Json(const std::string& file) {
    return nlohmann::json::parse(std::ifstream(*folder_ / file));
  }

  static std::unique_ptr<test::TempFolder> folder_;
};

std::unique_ptr<test::TempFolder> Associate::folder_;

TEST_F(Associate, IsByVotesWhereIdsAreOfOneFrame) {
  const CommandOutput output = Run("map", "map", {"--until", "12", "--remove", "object2,2"});
  ASSERT_EQ(output.exit_code, 0) << output.err;
  EXPECT_NE(output.err.find("mini: the map's ids are its own, found by votes; poses are tracked"),
            std::string::npos)
      << output.err;
  const nlohmann::json stats = Json("map/stats.json");
  EXPECT_EQ(stats["associate"], "votes");
  EXPECT_EQ(stats["poses"], "track");
  EXPECT_EQ(stats["removed"], nlohmann::json::array({2}));
  EXPECT_TRUE(fs::exists(*folder_ / "map/mesh/background-0.ply"));
  EXPECT_TRUE(fs::exists(*folder_ / "map/mesh/object1-1.ply"));
  EXPECT_FALSE(fs::exists(*folder_ / "map/mesh/object2-2.ply"));
  EXPECT_FALSE(fs::exists(*folder_ / "map/mesh/object3-3.ply")) << "a third object";
  EXPECT_TRUE(fs::exists(*folder_ / "map/trajectories/object2-2.txt"));
}

TEST_F(Associate, GoesOnFromASavedMap) {
  ASSERT_EQ(Run("map", "half", {"--until", "6", "--save", *folder_ / "half.map"}).exit_code, 0);
  const CommandOutput output =
      Run("map", "rest", {"--load", *folder_ / "half.map", "--until", "10"});
  ASSERT_EQ(output.exit_code, 0) << output.err;
  EXPECT_EQ(Json("rest/stats.json")["associate"], "votes");
  EXPECT_TRUE(fs::exists(*folder_ / "rest/mesh/object2-2.ply"));
  EXPECT_FALSE(fs::exists(*folder_ / "rest/mesh/object3-3.ply")) << "a known object was born again";
}

// A map by given ids takes none that are drawn anew.
TEST_F(Associate, AMapByGivenIdsTakesNoOthers) {
  const fs::path saved = *folder_ / "given.map";
  ASSERT_EQ(
      Run("map", "given", {"--segmentation", "none", "--until", "4", "--save", saved}).exit_code,
      0);
  const CommandOutput output = Run("map", "drawn", {"--load", saved, "--until", "6"});
  EXPECT_EQ(output.exit_code, kUsage);
  EXPECT_NE(output.err.find("is a map by given ids, and the ids in the masks of"),
            std::string::npos)
      << output.err;
  EXPECT_FALSE(fs::exists(*folder_ / "drawn"));
  const CommandOutput none =
      Run("map", "none", {"--segmentation", "none", "--load", saved, "--until", "6"});
  EXPECT_EQ(none.exit_code, 0) << none.err;
}

// What needs more frames than there are to be confirmed is never born.
TEST_F(Associate, SettingsReachTheVotes) {
  ASSERT_EQ(Run("map", "half", {"--until", "4", "--save", *folder_ / "half.map"}).exit_code, 0);
  const fs::path settings = Settings("confirm_frames = 7\nconfirm_window = 7");
  ASSERT_EQ(Run("map", "late", {"--until", "6", "--vote-config", settings}).exit_code, 0);
  EXPECT_FALSE(fs::exists(*folder_ / "late/mesh/object1-1.ply"));
  ASSERT_EQ(Run("map", "born",
                {"--load", *folder_ / "half.map", "--until", "8", "--vote-config", settings})
                .exit_code,
            0);
  EXPECT_TRUE(fs::exists(*folder_ / "born/mesh/object1-1.ply"));
  ASSERT_EQ(Run("compare", "late-compare",
                {"--until", "6", "--methods", "tsdf++/anchored", "--profiles", "close",
                 "--vote-config", settings})
                .exit_code,
            0);
  const nlohmann::json summary = Json("late-compare/summary.json");
  EXPECT_TRUE(summary["runs"][0]["matched_ids"].empty());
  EXPECT_NE(summary["command"].get<std::string>().find(" --vote-config "), std::string::npos);
}

TEST_F(Associate, RefusesWhatDoesNotGoTogether) {
  ASSERT_EQ(Run("map", "half", {"--until", "4", "--save", *folder_ / "half.map"}).exit_code, 0);
  const auto sentence = [](const CommandOutput& output) {
    EXPECT_EQ(output.exit_code, kUsage);
    return output.err;
  };
  EXPECT_NE(sentence(Run("map", "no", {"--associate", "given"}))
                .find("--associate given: the ids in the masks of mini are drawn anew in every "
                      "frame, expected --associate votes"),
            std::string::npos);
  EXPECT_NE(sentence(Run("compare", "no", {"--associate", "given"}))
                .find("--associate given: the ids in the masks of mini are drawn anew"),
            std::string::npos);
  EXPECT_NE(sentence(Run("map", "no", {"--poses", "gt"}))
                .find("--poses gt are the poses of given ids, and --associate votes gives ids of "
                      "its own: expected --poses icp or track, or --associate given"),
            std::string::npos);
  EXPECT_NE(
      sentence(Run("compare", "no", {"--poses", "gt"})).find("given poses are those of given"),
      std::string::npos);
  const std::string scene = TSDFPP_SOURCE_DIR "/scenes/mini.toml";
  for (const std::string command : {"map", "compare"}) {
    EXPECT_NE(sentence(Run(command, "no", {"--vote-config", Settings("far = 1")})).find("far"),
              std::string::npos);
    EXPECT_NE(sentence(RunTsdfpp({command, scene, "--out", *folder_ / "no", "--vote-config",
                                  Settings("")},
                                 folder_->path()))
                  .find("--vote-config needs votes, and the objects' ids are given"),
              std::string::npos);
  }
  EXPECT_NE(sentence(RunTsdfpp({"map", "--load", *folder_ / "half.map", "--out", *folder_ / "no",
                                "--vote-config", Settings("")},
                               folder_->path()))
                .find("--vote-config needs a sequence to map"),
            std::string::npos);
  EXPECT_FALSE(fs::exists(*folder_ / "no"));
  EXPECT_NE(sentence(Run("map", "no", {"--load", *folder_ / "half.map", "--associate", "votes"}))
                .find("--associate cannot be given with --load, whose map has its own"),
            std::string::npos);
}

TEST_F(Associate, IsMatchedToTheTruthByOverlap) {
  const CommandOutput output =
      Run("compare", "compare",
          {"--until", "10", "--every", "5", "--methods", "tsdf++/anchored", "--profiles", "close"});
  ASSERT_EQ(output.exit_code, 0) << output.err;
  const nlohmann::json run = Json("compare/summary.json")["runs"][0];
  EXPECT_EQ(run["associate"], "votes");
  EXPECT_EQ(run["title"], "tsdf++/anchored, close, tracked, ids by votes");
  ASSERT_EQ(run["matched_ids"].size(), 2U) << run["matched_ids"];
  std::set<int> objects;
  for (const nlohmann::json& match : run["matched_ids"]) {
    objects.insert(match["object"].get<int>());
    EXPECT_EQ(match["share"], 1.0);
  }
  EXPECT_EQ(objects, (std::set<int>{1, 2}));
  // The objects' own surfaces are there under the truth's ids.
  for (const nlohmann::json& object : run["examined"]["objects"]) {
    EXPECT_GT(object["completion"].get<double>(), 0.5) << object["name"];
  }
}

// Which objects there are is known only in the end.
TEST_F(Associate, AMeshOfSomebodyElseStays) {
  const fs::path theirs = *folder_ / "theirs/mesh/object1-1.ply";
  ASSERT_TRUE(WriteFile(theirs, "kept").has_value());
  const CommandOutput output = Run("map", "theirs", {"--until", "12"});
  EXPECT_EQ(output.exit_code, test::kUsage) << output.err;
  EXPECT_NE(output.err.find("object1-1.ply: is of no earlier run and would be replaced"),
            std::string::npos)
      << output.err;
  EXPECT_EQ(ReadFile(theirs), "kept");
  EXPECT_FALSE(fs::exists(*folder_ / "theirs/stats.json"));
}

}  // namespace
}  // namespace tsdfpp
