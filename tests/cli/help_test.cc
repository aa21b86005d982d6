// Help, JSON and what doctor says.
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "tests/cli/run_command.h"
#include "tests/core/temp_folder.h"

namespace tsdfpp {
namespace {

using test::CommandOutput;
using test::RunTsdfpp;
using test::TempFolder;

const char* const kMini = TSDFPP_SOURCE_DIR "/scenes/mini.toml";

TEST(CommandHelp, EverySubcommandHasHelp) {
  const TempFolder folder;
  const CommandOutput top = RunTsdfpp({"--help"}, folder.path());
  EXPECT_EQ(top.exit_code, 0);
  EXPECT_EQ(top.err, "");
  for (const char* command : {"doctor", "generate", "map", "compare", "metric"}) {
    EXPECT_NE(top.out.find(command), std::string::npos) << command;
    const CommandOutput help = RunTsdfpp({command, "--help"}, folder.path());
    EXPECT_EQ(help.exit_code, 0) << command;
    EXPECT_EQ(help.err, "") << command;
    for (const char* option : {"Usage: tsdfpp", command, "--json", "--threads", "--help"}) {
      EXPECT_NE(help.out.find(option), std::string::npos) << command << ": " << option;
    }
  }
  const CommandOutput version = RunTsdfpp({"--version"}, folder.path());
  EXPECT_EQ(version.exit_code, 0);
  EXPECT_FALSE(version.out.empty());
}

TEST(CommandDoctor, SaysWhatRenders) {
  const TempFolder folder;
  const CommandOutput json = RunTsdfpp({"doctor", "--json"}, folder.path());
  ASSERT_EQ(json.exit_code, 0) << json.err;
  EXPECT_EQ(json.err, "");
  const auto parsed = nlohmann::json::parse(json.out, nullptr, false);
  ASSERT_FALSE(parsed.is_discarded()) << json.out;
  const std::string renderer = parsed.at("gl").at("renderer");
  EXPECT_FALSE(renderer.empty());
  EXPECT_GE(parsed.at("cores").get<int>(), 1);
  for (const char* name : {"mujoco", "opencv", "pcl", "open3d", "eigen", "tsdfpp"}) {
    EXPECT_FALSE(parsed.at(name).get<std::string>().empty()) << name;
  }
  const CommandOutput text = RunTsdfpp({"doctor"}, folder.path());
  EXPECT_EQ(text.exit_code, 0);
  EXPECT_NE(text.out.find(renderer), std::string::npos) << text.out;

  const CommandOutput osmesa = RunTsdfpp({"doctor"}, folder.path(), {{"MUJOCO_GL", "osmesa"}});
  EXPECT_EQ(osmesa.exit_code, 0) << osmesa.err;
  EXPECT_NE(osmesa.out.find("osmesa"), std::string::npos) << osmesa.out;
}

// What can be known without OpenGL is said all the same; then the fault decides.
TEST(CommandDoctor, SaysTheRestWhereNothingRenders) {
  const TempFolder folder;
  const test::CommandOutput text =
      RunTsdfpp({"doctor"}, folder.path(), {{"MUJOCO_GL", "nonsense"}});
  EXPECT_EQ(text.exit_code, 2);
  EXPECT_EQ(text.err, "tsdfpp: MUJOCO_GL is 'nonsense', expected 'egl' or 'osmesa'\n");
  EXPECT_NE(text.out.find("MuJoCo"), std::string::npos) << text.out;
  EXPECT_EQ(text.out.find("Nothing is missing"), std::string::npos) << text.out;
  const CommandOutput json =
      RunTsdfpp({"doctor", "--json"}, folder.path(), {{"MUJOCO_GL", "nonsense"}});
  EXPECT_EQ(json.exit_code, 2);
  const auto parsed = nlohmann::json::parse(json.out, nullptr, false);
  ASSERT_FALSE(parsed.is_discarded()) << json.out;
  EXPECT_TRUE(parsed.at("gl").is_null());
}

TEST(CommandJson, IsAllThatStdoutHolds) {
  const TempFolder folder;
  const std::vector<std::vector<std::string>> commands{
      {"map", kMini, "--json", "--until", "2", "--remove", "house", "--out", folder / "map"},
      {"compare", kMini, "--json", "--until", "4", "--methods", "tsdf", "--profiles", "close",
       "--out", folder / "compare"},
  };
  for (const auto& arguments : commands) {
    const CommandOutput output = RunTsdfpp(arguments, folder.path());
    ASSERT_EQ(output.exit_code, 0) << output.err;
    EXPECT_EQ(output.err, "");
    const auto parsed = nlohmann::json::parse(output.out, nullptr, false);
    ASSERT_FALSE(parsed.is_discarded()) << output.out;
    EXPECT_EQ(parsed.at("sequence"), "mini");
    if (arguments.front() == "map") {
      EXPECT_EQ(parsed.at("removed"), nlohmann::json({2}));
    }
  }
  EXPECT_FALSE(std::filesystem::exists((folder / "map") / "mesh" / "house-2.ply"));
}

}  // namespace
}  // namespace tsdfpp
