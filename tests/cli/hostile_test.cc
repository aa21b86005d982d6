// Data that means ill, through the command: one sentence and the right exit code, in time, and
// nothing outside of the folder that was asked for.
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "core/files.h"
#include "core/json_text.h"
#include "core/one_line.h"
#include "sequence/cofusion_layout.h"
#include "sequence/cofusion_writer.h"
#include "sequence/export.h"
#include "tests/cli/run_command.h"
#include "tests/core/temp_folder.h"
#include "tests/sequence/box_source.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;
using test::CommandOutput;
using test::kData;
using test::kEnvironment;
using test::kUsage;
using test::RunTsdfpp;
using Variables = std::map<std::string, std::string>;

class Hostile : public testing::Test {
 protected:
  void SetUp() override {
    fs::remove_all(folder_ / "set");
    test::BoxSource source(3);
    ASSERT_TRUE(
        WriteCofusion(source, {"0", std::nullopt, "none", "", ""}, folder_ / "set").has_value());
  }

  // Replaces what stands first in a file of the set.
  void Spoil(const std::string& file, const std::string& from, const std::string& to) {
    std::string text = ReadFile(folder_ / "set" / file).value();
    const std::size_t at = text.find(from);
    ASSERT_NE(at, std::string::npos) << from;
    text.replace(at, from.size(), to);
    ASSERT_TRUE(WriteFile(folder_ / "set" / file, text).has_value());
  }

  CommandOutput Map(const fs::path& set, const std::vector<std::string>& more = {},
                    const Variables& variables = {}) {
    std::vector<std::string> arguments{"map", set, "--out", folder_ / "a/b/out", "--voxel", "0.05"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return RunTsdfpp(arguments, folder_.path(), variables);
  }

  static void ExpectSentence(const CommandOutput& output, int code, const std::string& words) {
    EXPECT_EQ(output.exit_code, code) << output.err;
    EXPECT_EQ(output.out, "");
    EXPECT_NE(output.err.find(words), std::string::npos) << output.err;
    EXPECT_TRUE(output.err.starts_with("tsdfpp: ")) << output.err;
    ASSERT_FALSE(output.err.empty());
    EXPECT_EQ(output.err.back(), '\n');
    const std::string line = output.err.substr(0, output.err.size() - 1);
    EXPECT_FALSE(HasControl(line)) << output.err;
    EXPECT_TRUE(IsUtf8(line));
    EXPECT_LT(output.err.size(), 500U);
  }

  // Regular files below the test's folder that lie neither in the set nor in the output.
  std::vector<std::string> Strangers() const {
    std::vector<std::string> found;
    for (const auto& entry : fs::recursive_directory_iterator(folder_.path())) {
      const std::string file = entry.path().lexically_relative(folder_.path()).string();
      if (!entry.is_regular_file() || file.starts_with("set") || file.starts_with("a/b/out")) {
        continue;
      }
      if (file != "stdout.txt" && file != "stderr.txt") found.push_back(file);
    }
    return found;
  }

  const test::TempFolder folder_;
};

TEST_F(Hostile, NamesDoNotLeadOutOfTheOutput) {
  ASSERT_EQ(Map(folder_ / "set").exit_code, 0);
  for (const char* name : {"../../../pwned", "/pwned", "..", "a\\nb", "\\u0001", ""}) {
    SetUp();
    const std::string json = ReadFile(folder_ / "set/sequence.json").value();
    const std::size_t at = json.find("\"name\": \"") + 9;
    Spoil("sequence.json", "\"name\": \"" + json.substr(at, json.find('"', at) - at) + "\"",
          "\"name\": \"" + std::string(name) + "\"");
    ExpectSentence(Map(folder_ / "set"), kData, "sequence.json: object 0: the name '");
    EXPECT_EQ(Strangers(), std::vector<std::string>());
  }
}

TEST_F(Hostile, ListedFilesAreInsideAndRegular) {
  Spoil("sequence.json", "\"calibration.txt\"", "\"/dev/zero\"");
  ExpectSentence(RunTsdfpp({"verify", folder_ / "set"}, folder_.path()), kData,
                 "the path '/dev/zero' is absolute");
  SetUp();
  const fs::path camera = folder_ / "set/trajectories/gt-cam-0.txt";
  fs::remove(camera);
  ASSERT_EQ(mkfifo(camera.c_str(), 0600), 0);
  ExpectSentence(Map(folder_ / "set"), kData, "gt-cam-0.txt: is a pipe");
}

TEST_F(Hostile, LinksThatLeadOutAreFollowedIfAsked) {
  fs::rename(folder_ / "set/colour", folder_ / "elsewhere");
  fs::create_directory_symlink(folder_ / "elsewhere", folder_ / "set/colour");
  ExpectSentence(Map(folder_ / "set"), kData, "set/colour: leads by a link to '");
  const CommandOutput followed = Map(folder_ / "set", {"--follow-links"});
  EXPECT_EQ(followed.exit_code, 0) << followed.err;
}

// A .klg that is named itself may lie among other things; what is read beside it stays there.
TEST_F(Hostile, LinksBesideARecordingThatIsNamed) {
  test::BoxSource source(3);
  ASSERT_TRUE(ExportSequence(source, DatasetFormat::kKlg, folder_ / "set/klg").has_value());
  fs::path recording;
  for (const auto& entry : fs::directory_iterator(folder_ / "set/klg")) {
    if (entry.path().extension() == ".klg") recording = entry.path();
  }
  const fs::path poses = folder_ / "set/klg/groundtruth.txt";
  fs::create_symlink("/etc", folder_ / "set/klg/another");
  const CommandOutput sound = Map(recording);
  EXPECT_EQ(sound.exit_code, 0) << sound.err;
  ASSERT_TRUE(WriteFile(folder_ / "set/secret", "SECRET x").has_value());
  fs::remove(poses);
  fs::create_symlink(folder_ / "set/secret", poses);
  const CommandOutput refused = Map(recording);
  ExpectSentence(refused, kData, "groundtruth.txt: leads by a link to '");
  EXPECT_EQ(refused.err.find("SECRET"), std::string::npos) << refused.err;
}

TEST_F(Hostile, DepthAndSizesAreLimited) {
  Spoil("sequence.json", "\"schema_version\": 2",
        "\"schema_version\": " + std::string(200'000, '[') + std::string(200'000, ']'));
  ExpectSentence(Map(folder_ / "set"), kData, "over the limit of 64");
  SetUp();
  Spoil("sequence.json", "\"frame_count\": 3", "\"frame_count\": 2147483647");
  ExpectSentence(Map(folder_ / "set"), kData, "frame_count is 2147483647");
  SetUp();
  // A PNG that says it has 30,000 x 30,000 pixels.
  const std::string side("\x00\x00\x75\x30", 4);
  std::string png = ReadFile(folder_ / "set/colour/Color0001.png").value_or("");
  const std::string image = png.empty() ? "colour/Color0000.png" : "colour/Color0001.png";
  png = ReadFile(folder_ / "set" / image).value();
  png.replace(16, 8, side + side);
  ASSERT_TRUE(WriteFile(folder_ / "set" / image, png).has_value());
  ExpectSentence(Map(folder_ / "set"), kData,
                 "30000 pixels along a side of the image, over the limit of 16384");
}

TEST_F(Hostile, LimitsAreSetByTheEnvironment) {
  ExpectSentence(Map(folder_ / "set", {}, {{"TSDFPP_LIMITS", "frames=2"}}), kData,
                 "frame_count is 3, expected a whole number from 0 to 2");
  ExpectSentence(Map(folder_ / "set", {}, {{"TSDFPP_LIMITS", "frame=2"}}), kUsage,
                 "TSDFPP_LIMITS: 'frame=2' is no name=value");
  EXPECT_EQ(Map(folder_ / "set", {}, {{"TSDFPP_LIMITS", "frames=3"}}).exit_code, 0);
}

// A path may hold any byte; what is printed of it is text all the same.
TEST_F(Hostile, WhatIsToBeRemovedIsThere) {
  for (const char* removed : {"[0]", "[9]", "[1, 1]"}) {
    SetUp();
    std::string text = ReadFile(folder_ / "set/sequence.json").value();
    nlohmann::json edited = nlohmann::json::parse(text);
    edited["reveal"] = {{"frame", 1}, {"removed", nlohmann::json::parse(removed)}};
    ASSERT_TRUE(WriteFile(folder_ / "set/sequence.json", edited.dump()).has_value());
    ExpectSentence(Map(folder_ / "set"), kData, "expected objects of the sequence, each once");
  }
  SetUp();
  nlohmann::json slow = nlohmann::json::parse(ReadFile(folder_ / "set/sequence.json").value());
  slow["rate_hz"] = 5e-324;
  ASSERT_TRUE(WriteFile(folder_ / "set/sequence.json", slow.dump()).has_value());
  ExpectSentence(Map(folder_ / "set"), kData, "expected a rate_hz of 1e-06 to 1e+09");
}

// A scene of a dataset that is named alone: the models lie beside it.
TEST_F(Hostile, LinksToModelsOfADataset) {
  test::BoxSource source(3);
  ASSERT_TRUE(ExportSequence(source, DatasetFormat::kBop, folder_ / "set/bop").has_value());
  const fs::path scene = folder_ / "set/bop/test/000000";
  const CommandOutput sound = Map(scene);
  EXPECT_EQ(sound.exit_code, 0) << sound.err;
  for (const auto& entry : fs::directory_iterator(folder_ / "set/bop/models")) {
    if (entry.path().extension() != ".ply") continue;
    fs::remove(entry.path());
    fs::create_symlink("/etc/hostname", entry.path());
    break;
  }
  ExpectSentence(Map(scene), kData, "leads by a link to '");
}

TEST_F(Hostile, PathsThatAreNoText) {
  const std::string odd = "b\xff\nc\x1b[31m";
  fs::rename(folder_ / "set", folder_ / odd);
  const CommandOutput output = RunTsdfpp(
      {"map", folder_ / odd, "--out", folder_ / ("out" + odd), "--voxel", "0.05", "--json"},
      folder_.path());
  EXPECT_EQ(output.exit_code, 0) << output.err;
  EXPECT_TRUE(IsUtf8(output.out));
  EXPECT_TRUE(ParseJsonObject(output.out, "stdout").has_value()) << output.out;
  fs::remove(folder_ / odd / "calibration.txt");
  const CommandOutput refused = Map(folder_ / odd);
  EXPECT_NE(refused.exit_code, 0);
  EXPECT_FALSE(HasControl(refused.err.substr(0, refused.err.size() - 1))) << refused.err;
  EXPECT_TRUE(IsUtf8(refused.err));
}

TEST_F(Hostile, NamesThatAreTooLong) {
  const std::string longer(300, 'n');
  ExpectSentence(Map(folder_ / longer), kUsage, "no such scene");
  for (const char* command : {"verify", "report"}) {
    const CommandOutput output = RunTsdfpp({command, folder_ / longer}, folder_.path());
    EXPECT_NE(output.exit_code, 0);
    EXPECT_LT(output.err.size(), 500U);
  }
  const CommandOutput output =
      RunTsdfpp({"map", folder_ / "set", "--out", folder_ / longer}, folder_.path());
  ExpectSentence(output, kEnvironment, "the folder cannot be made");
}

// Before the work: the set's last frame, which cannot be read, is not met.
TEST_F(Hostile, WhatIsInTheWayIsSaidFirst) {
  fs::resize_file(folder_ / "set" / cofusion::DepthFile(2), 10);
  ExpectSentence(Map(folder_ / "set"), kData, cofusion::DepthFile(2));
  ASSERT_TRUE(WriteFile(folder_ / "a/b/out/mesh", "mine").has_value());
  ExpectSentence(Map(folder_ / "set"), kUsage, "mesh: is a file, expected a folder or nothing");
  const auto compare = [&] {
    return RunTsdfpp({"compare", folder_ / "set", "--out", folder_ / "c", "--voxel", "0.05",
                      "--methods", "tsdf", "--profiles", "close"},
                     folder_.path());
  };
  const auto free = compare();
  EXPECT_EQ(free.exit_code, kData) << free.err;
  ASSERT_TRUE(WriteFile(folder_ / "c/tsdf_close_gt", "mine").has_value());
  ExpectSentence(compare(), kUsage, "tsdf_close_gt: is a file, expected a folder or nothing");
  ASSERT_TRUE(WriteFile(folder_ / "d/run.json/mine", "mine").has_value());
  ExpectSentence(RunTsdfpp({"map", folder_ / "set", "--out", folder_ / "d", "--voxel", "0.05"},
                           folder_.path()),
                 kUsage, "run.json: is a folder with files in it");
}

// Beyond where single precision can hold the square of a distance.
TEST_F(Hostile, WhatLiesBeyondAllDistanceIsRefused) {
  ASSERT_TRUE(WriteFile(folder_ / "far.ply",
                        "ply\nformat ascii 1.0\nelement vertex 6\nproperty float x\n"
                        "property float y\nproperty float z\nelement face 2\n"
                        "property list uchar int vertex_indices\nend_header\n"
                        "0 0 0\n1 0 0\n0 1 0\n-1e20 -1e20 0\n1e20 -1e20 0\n0 1e20 0\n"
                        "3 0 1 2\n3 3 4 5\n")
                  .has_value());
  ExpectSentence(
      RunTsdfpp({"metric", "surface", folder_ / "far.ply", folder_ / "far.ply"}, folder_.path()),
      kData, "far.ply: at scale 1 a position is 1e+20 from the origin, expected at most 1e+07");
  // A mapper's meshes: those without an object, too.
  ASSERT_EQ(Map(folder_ / "set").exit_code, 0);
  fs::copy(folder_ / "a/b/out/mesh", folder_ / "meshes");
  fs::copy_file(folder_ / "far.ply", folder_ / "meshes/scene-without-8.ply");
  ExpectSentence(RunTsdfpp({"evaluate", folder_ / "set", "--meshes", folder_ / "meshes", "--at",
                            "2", "--removed", "right"},
                           folder_.path()),
                 kData, "scene-without-8.ply: at scale 1 a position is 1e+20");
  // A path of the truth.
  const std::string path = "trajectories/gt-right-8.txt";
  std::string text = ReadFile(folder_ / "set" / path).value();
  const std::size_t line = text.find("\n1 ");
  ASSERT_NE(line, std::string::npos);
  text.replace(line + 3, text.find(' ', line + 3) - line - 3, "1e20");
  ASSERT_TRUE(WriteFile(folder_ / "set" / path, text).has_value());
  const CommandOutput verified = RunTsdfpp({"verify", folder_ / "set"}, folder_.path());
  EXPECT_EQ(verified.exit_code, kData) << verified.err;
  EXPECT_NE((verified.out + verified.err).find("1e+20 m from the origin"), std::string::npos)
      << verified.out << verified.err;
}

// Two things answer to one name: which is meant?
TEST_F(Hostile, WhatIsThereTwiceIsRefused) {
  Spoil("sequence.json", "\"left\"", "\"8\"");
  ExpectSentence(Map(folder_ / "set", {"--remove", "8"}), kUsage,
                 "object '8' may be 8 (3) or right (8) of sequence ");
  for (const char* name : {"000002", "2"}) {
    ASSERT_TRUE(fs::create_directories(folder_ / "meshes" / name));
  }
  const CommandOutput evaluated = RunTsdfpp(
      {"evaluate", folder_ / "set", "--meshes", folder_ / "meshes", "--at", "2"}, folder_.path());
  EXPECT_EQ(evaluated.exit_code, kData);
  EXPECT_NE(evaluated.err.find("are both of frame 2"), std::string::npos) << evaluated.err;
  SetUp();
  ASSERT_EQ(RunTsdfpp({"export", folder_ / "set", "--to", "7scenes", "--out", folder_ / "seven"},
                      folder_.path())
                .exit_code,
            0);
  for (const char* part : {"color.png", "depth.png", "pose.txt", "mask.png"}) {
    const fs::path from = folder_ / "seven" / (std::string("frame-000001.") + part);
    if (fs::exists(from)) fs::rename(from, folder_ / "seven" / (std::string("frame-2.") + part));
  }
  ExpectSentence(Map(folder_ / "seven"), kData, "are both of frame 2");
}

// Masks that show an object that the sequence does not list: it is in the map, and is kept.
TEST_F(Hostile, ObjectsThatNobodyListsAreKept) {
  Spoil("sequence.json", "\"id\": 8", "\"id\": 9");
  fs::remove(folder_ / "set/trajectories/gt-right-8.txt");
  const fs::path file = folder_ / "a/b/out.map";
  const CommandOutput begun = Map(folder_ / "set", {"--until", "1", "--save", file});
  ASSERT_EQ(begun.exit_code, 0) << begun.err;
  EXPECT_TRUE(fs::exists(folder_ / "a/b/out/mesh/object8-8.ply"));
  const std::string out = folder_ / "a/b/out";
  const CommandOutput alone =
      RunTsdfpp({"map", "--load", file, "--remove", "object8", "--out", out}, folder_.path());
  EXPECT_EQ(alone.exit_code, 0) << alone.err;
  const CommandOutput rest =
      RunTsdfpp({"map", folder_ / "set", "--load", file, "--out", out}, folder_.path());
  EXPECT_EQ(rest.exit_code, 0) << rest.err;
  EXPECT_TRUE(fs::exists(folder_ / "a/b/out/mesh/object8-8.ply"));
}

// What a loaded map cannot say is asked for again, or said to be wrong.
TEST_F(Hostile, SettingsOfTrackingAreNotLeftOut) {
  const fs::path file = folder_ / "a/b/out.map";
  ASSERT_EQ(Map(folder_ / "set", {"--until", "1", "--save", file, "--poses", "icp"}).exit_code, 0);
  const auto go_on = [&](const std::vector<std::string>& more) {
    std::vector<std::string> arguments{"map", folder_ / "set", "--load",
                                       file,  "--out",         folder_ / "a/b/out"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return RunTsdfpp(arguments, folder_.path());
  };
  const CommandOutput all = go_on({"--track", "all"});
  EXPECT_EQ(all.exit_code, 0) << all.err;
  EXPECT_NE(all.err.find("tracked is all that is not background"), std::string::npos) << all.err;
  ExpectSentence(go_on({"--track", "moving"}), kUsage,
                 "--track moving needs --poses track, found --poses icp");
  ExpectSentence(go_on({"--track-config", folder_ / "none.toml"}), kUsage, "no such file");
  ASSERT_TRUE(WriteFile(folder_ / "track.toml", "min_points = 40\n").has_value());
  ExpectSentence(go_on({"--track-config", folder_ / "track.toml"}), kUsage,
                 "--track-config needs --poses track");
  ExpectSentence(RunTsdfpp({"map", "--load", file, "--track", "all", "--out", folder_ / "a/b/out"},
                           folder_.path()),
                 kUsage, "--track needs a sequence to map");
  ExpectSentence(Map(folder_ / "set", {"--method", "surfels", "--associate", "votes"}), kUsage,
                 "association by votes asks a map for its voxels, which method 'surfels' has not");
}

// The page of a run would take the place of the run.
TEST_F(Hostile, WhatAPageIsMadeOfIsNotWrittenOver) {
  const fs::path run = folder_ / "run";
  const std::string note =
      R"({"schema":1,"generator":"tsdfpp","run":"0123456789abcdef","command":"c",)"
      R"("files":[{"name":"summary.json","bytes":2}]})";
  for (const auto& [file, text] : std::map<std::string, std::string>{
           {"run.json", note}, {"summary.json", "{}"}, {"gates.json", "{}"}}) {
    ASSERT_TRUE(WriteFile(run / file, text).has_value());
  }
  for (const char* file : {"run.json", "summary.json", "gates.json", "../run/summary.json"}) {
    ExpectSentence(RunTsdfpp({"report", run, "--out", run / file}, folder_.path()), kUsage,
                   "is a file that the page is made of, expected another");
  }
  EXPECT_EQ(ReadFile(run / "run.json").value(), note);
  EXPECT_EQ(ReadFile(run / "summary.json").value(), "{}");
}

TEST_F(Hostile, FramesThatAreClaimedAreListed) {
  Spoil("sequence.json", "\"frame_count\": 3", "\"frame_count\": 1000000");
  const CommandOutput output = RunTsdfpp({"verify", folder_ / "set"}, folder_.path());
  ExpectSentence(output, kData, "sequence.json: frame_count is 1000000, but only ");
}

TEST_F(Hostile, PipesThatAreTypedAreRefused) {
  ASSERT_EQ(mkfifo((folder_ / "pipe").c_str(), 0600), 0);
  for (const auto& arguments :
       {std::vector<std::string>{"metric", "trajectory", folder_ / "pipe", folder_ / "pipe"},
        {"metric", "surface", (folder_ / "pipe.ply").string(), (folder_ / "pipe.ply").string()},
        {"map", "--load", folder_ / "pipe", "--out", folder_ / "out"},
        {"map", folder_ / "set", "--calibration", folder_ / "pipe", "--out", folder_ / "out"}}) {
    if (arguments[1] == "surface" && !fs::exists(folder_ / "pipe.ply")) {
      ASSERT_EQ(mkfifo((folder_ / "pipe.ply").c_str(), 0600), 0);
    }
    const CommandOutput output = RunTsdfpp(arguments, folder_.path());
    EXPECT_NE(output.exit_code, 0);
    EXPECT_NE(output.err.find("is a pipe, expected a regular file"), std::string::npos)
        << output.err;
  }
}

}  // namespace
}  // namespace tsdfpp
