// Where object poses come from if `--poses` is not given, on a set with masks and without poses.
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
using test::RunTsdfpp;

class PoseChoice : public testing::Test {
 protected:
  // scenes/mini.toml, small, with a car and a house, of which only masks tell; rendered once.
  static void SetUpTestSuite() {
    folder_ = std::make_unique<test::TempFolder>();
    const std::string scene = TSDFPP_SOURCE_DIR "/scenes/mini.toml";
    const CommandOutput made = RunTsdfpp(
        {"generate", scene, "--no-antialias", "--out", *folder_ / "posed"}, folder_->path());
    ASSERT_EQ(made.exit_code, 0) << made.err;
    fs::copy(*folder_ / "posed", *folder_ / "bare", fs::copy_options::recursive);
    for (const auto& entry : fs::directory_iterator(*folder_ / "bare/trajectories")) {
      if (entry.path().filename() != "gt-cam-0.txt") fs::remove(entry.path());
    }
  }
  static void TearDownTestSuite() { folder_.reset(); }

  // Maps a few frames; returns what it says on the log.
  static std::string Map(const std::string& set, const std::vector<std::string>& more = {}) {
    std::vector<std::string> arguments{"map", *folder_ / set, "--out", *folder_ / "map", "--until",
                                       "4"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const CommandOutput output = RunTsdfpp(arguments, folder_->path());
    EXPECT_EQ(output.exit_code, 0) << output.err;
    return output.err;
  }
  static std::string Poses() {
    return nlohmann::json::parse(std::ifstream(*folder_ / "map/stats.json")).at("poses");
  }

  static std::unique_ptr<test::TempFolder> folder_;
};

std::unique_ptr<test::TempFolder> PoseChoice::folder_;

constexpr const char* kTracked = "mini: it holds no poses of objects, so they are tracked (";

TEST_F(PoseChoice, IsWhatTheFramesHave) {
  EXPECT_EQ(Map("posed").find(kTracked), std::string::npos);
  EXPECT_EQ(Poses(), "gt");
}

TEST_F(PoseChoice, IsToTrackWhereTheyHaveNone) {
  const std::string log = Map("bare");
  EXPECT_NE(log.find(std::string(kTracked) + "track)"), std::string::npos) << log;
  EXPECT_EQ(Poses(), "track");
  EXPECT_NE(Map("bare", {"--method", "surfels"}).find(std::string(kTracked) + "icp)"),
            std::string::npos)
      << "a method without signed distances";
  EXPECT_EQ(Poses(), "icp");
}

TEST_F(PoseChoice, IsAsTyped) {
  const std::string log = Map("bare", {"--poses", "gt"});
  EXPECT_NE(log.find("all are mapped as standing still"), std::string::npos) << log;
  EXPECT_EQ(Poses(), "gt");
}

TEST_F(PoseChoice, IsNotAskedOfTheBackground) {
  EXPECT_EQ(Map("bare", {"--segmentation", "none"}).find(kTracked), std::string::npos);
  EXPECT_EQ(Poses(), "gt");
}

}  // namespace
}  // namespace tsdfpp
