// Help, JSON and what doctor says.
#include <gtest/gtest.h>

#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <regex>
#include <set>
#include <sstream>
#include <string>

#include "core/files.h"
#include "core/gltf.h"
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
  for (const char* command :
       {"doctor", "generate", "verify", "export", "map", "compare", "evaluate", "report", "sweep",
        "replay", "bench-set", "gate", "metric"}) {
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

// Codecs bring some 240 libraries, which would be bound before every command (core/late_library.h).
TEST(CommandStart, LoadsNoCodecs) {
  const TempFolder folder;
  const CommandOutput listed =
      RunTsdfpp({"--version"}, folder.path(), {{"LD_TRACE_LOADED_OBJECTS", "1"}});
  EXPECT_NE(listed.out.find("libopencv_core"), std::string::npos) << listed.out;
  for (const char* library :
       {"libopencv_imgcodecs", "libopencv_videoio", "libgdal", "libavcodec"}) {
    EXPECT_EQ(listed.out.find(library), std::string::npos) << library;
  }
}

// What `tsdfpp methods` prints for plots and other programs is the row of the method.
TEST(CommandMethods, AreTheRows) {
  const TempFolder folder;
  const CommandOutput listed = RunTsdfpp({"methods", "--json"}, folder.path());
  ASSERT_EQ(listed.exit_code, 0) << listed.err;
  const auto rows = nlohmann::json::parse(listed.out);
  std::set<std::string> names;
  std::set<std::string> colours;
  const std::regex colour("#[0-9a-f]{6}");
  for (const auto& row : rows) {
    const std::string name = row.at("name");
    EXPECT_TRUE(names.insert(name).second) << name;
    EXPECT_EQ(row.at("has_voxels").get<bool>(), name != "surfels");
    for (const char* ground : {"on_light", "on_dark"}) {
      const std::string value = row.at(ground);
      EXPECT_TRUE(std::regex_match(value, colour)) << value;
      EXPECT_TRUE(colours.insert(ground + value).second) << name << " looks like another";
    }
  }
  // The default of --methods is a choice among them.
  const std::string help = RunTsdfpp({"compare", "--help"}, folder.path()).out;
  const std::regex chosen(R"(--methods TEXT=(\S+))");
  std::smatch found;
  ASSERT_TRUE(std::regex_search(help, found, chosen)) << help;
  std::istringstream choice(found.str(1));
  int count = 0;
  for (std::string name; std::getline(choice, name, ','); ++count) {
    EXPECT_TRUE(names.contains(name)) << name;
  }
  EXPECT_GT(count, 1);
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
  for (const char* name : {"mujoco", "opencv", "pcl", "open3d", "eigen", "tsdfpp", "children"}) {
    EXPECT_FALSE(parsed.at(name).get<std::string>().empty()) << name;
  }
  const CommandOutput text = RunTsdfpp({"doctor"}, folder.path());
  EXPECT_EQ(text.exit_code, 0);
  EXPECT_NE(text.out.find(renderer), std::string::npos) << text.out;
  EXPECT_NE(text.out.find("adapters ended by a watching process"), std::string::npos) << text.out;

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

// Every file of a folder but stats.json, whose times differ, and run.json, whose run does.
std::map<std::string, std::string> FilesOf(const std::filesystem::path& folder) {
  std::map<std::string, std::string> files;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    const std::string name = entry.path().filename();
    if (!entry.is_regular_file() || name == "stats.json" || name == "run.json") continue;
    files[std::filesystem::relative(entry.path(), folder)] = ReadFile(entry.path()).value();
  }
  return files;
}

// Stopped, saved, loaded and gone on with, a run leaves what it leaves in one go; and a file alone
// gives the meshes again.
TEST(CommandMap, GoesOnFromAFileAsIfItHadNotStopped) {
  const TempFolder folder;
  const auto run = [&](std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), "map");
    const CommandOutput output = RunTsdfpp(arguments, folder.path());
    ASSERT_EQ(output.exit_code, 0) << output.err;
  };
  run({kMini, "--until", "4", "--save", folder / "whole.map", "--out", folder / "whole"});
  run({kMini, "--until", "2", "--save", folder / "half.map", "--out", folder / "half"});
  run({kMini, "--load", folder / "half.map", "--until", "4", "--save", folder / "both.map", "--out",
       folder / "both"});
  run({"--load", folder / "both.map", "--save", folder / "again.map", "--out", folder / "again"});
  const auto whole = FilesOf(folder / "whole");
  EXPECT_GE(whole.size(), 4U);
  EXPECT_TRUE(FilesOf(folder / "both") == whole);
  EXPECT_TRUE(FilesOf(folder / "again") == whole);
  EXPECT_FALSE(FilesOf(folder / "half") == whole);
  const std::string bytes = ReadFile(folder / "whole.map").value();
  EXPECT_TRUE(ReadFile(folder / "both.map").value() == bytes);
  EXPECT_TRUE(ReadFile(folder / "again.map").value() == bytes);

  // Without a sequence there is no camera.
  const CommandOutput refused =
      RunTsdfpp({"map", "--load", folder / "both.map", "--views", "2", "--out", folder / "none"},
                folder.path());
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_EQ(refused.err,
            "tsdfpp: --views 2 needs a camera: name the sequence and map a frame of it\n");
  EXPECT_FALSE(std::filesystem::exists(folder / "none"));
}

// The plain kernels leave the same files as those of vectors; only what maps or segments takes the
// option.
TEST(CommandMap, KernelsChangeNoByte) {
  const TempFolder folder;
  for (const std::string kernels : {"simd", "plain"}) {
    const CommandOutput output =
        RunTsdfpp({"map", kMini, "--until", "2", "--views", "1", "--kernels", kernels, "--save",
                   folder / (kernels + ".map"), "--out", folder / kernels},
                  folder.path());
    ASSERT_EQ(output.exit_code, 0) << output.err;
    const auto stats = nlohmann::json::parse(ReadFile(folder / kernels / "stats.json").value());
    EXPECT_EQ(stats.at("kernels"), kernels);
  }
  const auto files = FilesOf(folder / "simd");
  EXPECT_GE(files.size(), 8U);
  EXPECT_TRUE(FilesOf(folder / "plain") == files);
  EXPECT_TRUE(ReadFile(folder / "plain.map").value() == ReadFile(folder / "simd.map").value());

  for (const char* command :
       {"map", "segment", "compare", "sweep", "replay", "bench-set", "gate"}) {
    const CommandOutput help = RunTsdfpp({command, "--help"}, folder.path());
    EXPECT_NE(help.out.find("--kernels"), std::string::npos) << command;
  }
  const CommandOutput unknown =
      RunTsdfpp({"map", kMini, "--kernels", "fast", "--out", folder / "none"}, folder.path());
  EXPECT_EQ(unknown.exit_code, 2);
  EXPECT_NE(unknown.err.find("--kernels"), std::string::npos) << unknown.err;
  const CommandOutput elsewhere = RunTsdfpp({"doctor", "--kernels", "plain"}, folder.path());
  EXPECT_EQ(elsewhere.exit_code, 2);
}

TEST(CommandMap, WritesGltfWithANodeAnObject) {
  const TempFolder folder;
  const std::vector<std::string> arguments{"map",           kMini, "--until", "2",
                                           "--mesh-format", "glb", "--out",   folder / "map"};
  const CommandOutput output = RunTsdfpp(arguments, folder.path());
  ASSERT_EQ(output.exit_code, 0) << output.err;
  const std::filesystem::path meshes = (folder / "map") / "mesh";
  const auto scene = ReadGlb(meshes / "scene.glb");
  ASSERT_TRUE(scene.has_value()) << scene.error().message;
  ASSERT_EQ(scene->size(), 3U);
  for (std::size_t i = 0; i < scene->size(); ++i) {
    const NamedMesh& object = (*scene)[i];
    EXPECT_EQ(object.id, i);
    EXPECT_FALSE(object.mesh.triangles.empty());
    const auto alone = ReadGlb(meshes / fmt::format("{}-{}.glb", object.name, object.id));
    ASSERT_TRUE(alone.has_value()) << alone.error().message;
    ASSERT_EQ(alone->size(), 1U);
    EXPECT_EQ(alone->front().id, object.id);
    EXPECT_GE(alone->front().mesh.triangles.size(), object.mesh.triangles.size());
  }
  EXPECT_FALSE(std::filesystem::exists(meshes / "scene.ply"));

  std::vector<std::string> wrong = arguments;
  wrong[5] = "stl";
  wrong[7] = folder / "none";
  const CommandOutput refused = RunTsdfpp(wrong, folder.path());
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_EQ(refused.err, "tsdfpp: mesh format 'stl' is unknown, expected ply or glb\n");
  EXPECT_FALSE(std::filesystem::exists(folder / "none"));
}

}  // namespace
}  // namespace tsdfpp
