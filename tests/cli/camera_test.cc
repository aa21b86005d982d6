// `--camera` of map and compare: what it finds, what it leaves behind, and what it refuses.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>

#include "tests/cli/run_command.h"
#include "tests/core/temp_folder.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;
using test::CommandOutput;
using test::kUsage;

constexpr const char* kFrames = "4";
// Of the camera's true path, which scenes have: a third of a voxel.
constexpr double kMost_m = 0.003;

class CameraCommand : public testing::Test {
 protected:
  // scenes/mini.toml, small; rendered once for all tests.
  static void SetUpTestSuite() {
    folder_ = std::make_unique<test::TempFolder>();
    const std::string scene = TSDFPP_SOURCE_DIR "/scenes/mini.toml";
    const CommandOutput made = test::RunTsdfpp(
        {"generate", scene, "--no-antialias", "--out", Sequence()}, folder_->path());
    ASSERT_EQ(made.exit_code, 0) << made.err;
  }
  static void TearDownTestSuite() { folder_.reset(); }
  static fs::path Sequence() { return *folder_ / "mini"; }
  static CommandOutput Run(std::vector<std::string> arguments) {
    return test::RunTsdfpp(arguments, folder_->path());
  }
  static std::unique_ptr<test::TempFolder> folder_;
};

std::unique_ptr<test::TempFolder> CameraCommand::folder_;

TEST_F(CameraCommand, MapWritesWhereTheCameraWas) {
  const fs::path out = *folder_ / "map";
  const CommandOutput run =
      Run({"map", Sequence(), "--camera", "track", "--until", kFrames, "--out", out});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const auto stats = nlohmann::json::parse(std::ifstream(out / "stats.json"));
  EXPECT_EQ(stats["camera"], "track");
  EXPECT_EQ(stats["camera_frames"]["located"], 3);
  EXPECT_EQ(stats["camera_frames"]["lost"], 0);
  EXPECT_TRUE(stats["times"].contains("locate"));
  EXPECT_TRUE(fs::exists(out / "trajectories/camera.txt"));
  const CommandOutput again = Run({"map", Sequence(), "--until", kFrames, "--out", out});
  ASSERT_EQ(again.exit_code, 0) << again.err;
  EXPECT_FALSE(fs::exists(out / "trajectories/camera.txt"));
}

TEST_F(CameraCommand, CompareScoresIt) {
  const fs::path out = *folder_ / "compared";
  const CommandOutput run =
      Run({"compare", Sequence(), "--camera", "track", "--methods", "tsdf++/anchored", "--profiles",
           "close", "--until", kFrames, "--out", out});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const auto summary = nlohmann::json::parse(std::ifstream(out / "summary.json"));
  const auto& camera = summary["runs"][0]["camera"];
  EXPECT_EQ(camera["source"], "track");
  EXPECT_EQ(camera["located"], 3);
  EXPECT_LT(camera["translation_rmse_m"].get<double>(), kMost_m);
  EXPECT_TRUE(camera.contains("rotation_rmse_deg"));
  EXPECT_NE(summary["command"].get<std::string>().find("--camera track"), std::string::npos);
}

TEST_F(CameraCommand, RefusesWhatDoesNotGoTogether) {
  const fs::path out = *folder_ / "out";
  const auto refuses = [&](std::vector<std::string> arguments, const std::string& words) {
    arguments.insert(arguments.end(), {"--out", out});
    const CommandOutput run = Run(arguments);
    EXPECT_EQ(run.exit_code, kUsage) << run.err;
    EXPECT_NE(run.err.find(words), std::string::npos) << run.err;
    EXPECT_FALSE(fs::exists(out));
  };
  refuses({"map", Sequence(), "--camera", "vicon"}, "--camera");
  refuses({"map", Sequence(), "--camera", "refine", "--method", "surfels"}, "'surfels'");
  refuses({"compare", Sequence(), "--camera", "track", "--methods", "tsdf,surfels"}, "'surfels'");
  const fs::path saved = *folder_ / "saved.map";
  ASSERT_EQ(Run({"map", Sequence(), "--until", "2", "--out", *folder_ / "two", "--save", saved})
                .exit_code,
            0);
  refuses({"map", "--load", saved, "--camera", "track"}, "--camera track needs a sequence");
}

// A loaded map has a background from the first frame on.
TEST_F(CameraCommand, GoesOnWithALoadedMap) {
  const fs::path saved = *folder_ / "half.map";
  ASSERT_EQ(Run({"map", Sequence(), "--until", "3", "--out", *folder_ / "half", "--save", saved})
                .exit_code,
            0);
  const fs::path out = *folder_ / "rest";
  const CommandOutput run =
      Run({"map", Sequence(), "--load", saved, "--camera", "refine", "--until", "6", "--out", out});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const auto stats = nlohmann::json::parse(std::ifstream(out / "stats.json"));
  EXPECT_EQ(stats["camera_frames"]["located"], 3);
}

}  // namespace
}  // namespace tsdfpp
