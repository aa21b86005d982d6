// What a user reads when something is wrong: one sentence on stderr, the right exit code, nothing
// on stdout, nothing half-written.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <string>
#include <vector>

#include "core/files.h"
#include "tests/cli/run_command.h"
#include "tests/core/temp_folder.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;
using test::CommandOutput;
using test::kData;
using test::kEnvironment;
using test::kUsage;
using test::RunTsdfpp;
using test::TempFolder;
using Variables = std::map<std::string, std::string>;

// Four frames of a few pixels.
const char* const kTinyScene = R"(name = "tiny"
purpose = "For tests of the command."
frames = 4
rate_hz = 30
[camera]
width = 64
height = 48
f = 50.0
cx = 32
cy = 24
target = [0.0, 0.0, 0.74]
azimuth_deg = [-100.0, -80.0]
radius_m = [1.2, 1.2]
height_m = [0.8, 0.8]
[[object]]
name = "mug"
id = 1
class = "mug"
model = "mug"
x = 0.0
y = 0.0
)";

void Write(const fs::path& file, const std::string& text) {
  std::ofstream(file, std::ios::binary) << text;
}

// All paths below the folder.
std::vector<std::string> Below(const fs::path& folder) {
  std::vector<std::string> paths;
  if (!fs::exists(folder)) return paths;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    paths.push_back(entry.path().string());
  }
  return paths;
}

class CommandErrors : public testing::Test {
 protected:
  void SetUp() override {
    scene_ = folder_ / "tiny.toml";
    out_ = folder_ / "out";
    Write(scene_, kTinyScene);
  }

  // The command fails with this code and one sentence that holds these words.
  void ExpectError(const std::vector<std::string>& arguments, int exit_code,
                   const std::vector<std::string>& words, const Variables& variables = {}) {
    std::string typed;
    for (const std::string& argument : arguments) typed += " " + argument;
    SCOPED_TRACE("tsdfpp" + typed);
    const CommandOutput output = RunTsdfpp(arguments, folder_.path(), variables);
    EXPECT_EQ(output.exit_code, exit_code);
    EXPECT_EQ(output.out, "");
    EXPECT_TRUE(output.err.starts_with("tsdfpp: ")) << output.err;
    EXPECT_EQ(std::count(output.err.begin(), output.err.end(), '\n'), 1) << output.err;
    EXPECT_TRUE(output.err.ends_with("\n")) << output.err;
    // A sentence, not a dump.
    EXPECT_LT(output.err.size(), 400U) << output.err;
    EXPECT_GT(output.err.size(), 20U) << output.err;
    for (const std::string& word : words) {
      EXPECT_NE(output.err.find(word), std::string::npos) << word << " is not in: " << output.err;
    }
    // The output folder may have been made; no file may be in it, and no hidden leftover beside it.
    EXPECT_EQ(Below(out_), std::vector<std::string>{});
    for (const auto& entry : fs::directory_iterator(folder_.path())) {
      EXPECT_FALSE(entry.path().filename().string().starts_with(".")) << entry.path();
    }
  }

  // A sequence on disk made from the tiny scene.
  std::string Generate() {
    std::string sequence = folder_ / "sequence";
    const CommandOutput output = RunTsdfpp({"generate", scene_, "--out", sequence}, folder_.path());
    EXPECT_EQ(output.exit_code, 0) << output.err;
    return sequence;
  }

  TempFolder folder_;
  std::string scene_;
  std::string out_;
};

TEST_F(CommandErrors, MapFiles) {
  const std::string file = folder_ / "tiny.map";
  const std::string begun = folder_ / "begun";
  ASSERT_EQ(
      RunTsdfpp({"map", scene_, "--until", "2", "--save", file, "--out", begun}, folder_.path())
          .exit_code,
      0);
  const std::vector<std::string> load = {"map", "--load", file, "--out", out_};
  const auto with = [&](const std::vector<std::string>& more) {
    std::vector<std::string> arguments = load;
    arguments.insert(arguments.end(), more.begin(), more.end());
    return arguments;
  };
  ExpectError(with({"--method", "tsdf"}), kUsage, {"--method", "--load"});
  ExpectError(with({"--voxel", "0.02"}), kUsage, {"--voxel", "--load"});
  ExpectError(with({"--until", "3"}), kUsage, {"--until 3", "sequence"});
  ExpectError(with({scene_, "--until", "2"}), kUsage, {"--until 2", "goes to 2"});
  ExpectError(with({scene_, "--until", "9"}), kUsage, {"--until 9", "up to 4"});
  for (const std::vector<std::string>& of_sequences :
       {std::vector<std::string>{"--calibration", "none"},
        {"--dataset", "bop"},
        {"--depth-units", "5"},
        {"--fixed-camera"},
        {"--pose-offset", "1"},
        {"--unchecked"}}) {
    ExpectError(with(of_sequences), kUsage, {of_sequences.front() + " needs a sequence to map"});
  }
  ExpectError(with({"--remove", "cup"}), kUsage, {"cup", "mug"});
  ExpectError(with({"--save", folder_.path()}), kUsage, {"--save", "folder"});
  ExpectError(with({"--save", file + "/a.map"}), kEnvironment, {file});
  ExpectError({"map", "--load", folder_ / "none.map", "--out", out_}, kData, {"none.map"});
  ExpectError({"map", "--load", scene_, "--out", out_}, kData, {"tiny.toml", "not a map file"});
  const std::string other = folder_ / "other.toml";
  std::string text = kTinyScene;
  text.replace(text.find("tiny"), 4, "wide");
  Write(other, text);
  ExpectError(with({other}), kUsage, {"tiny", "wide"});
  const std::string bytes = ReadFile(file).value();
  Write(file, bytes.substr(0, bytes.size() / 2));
  ExpectError(load, kData, {"tiny.map", "cut short"});
}

TEST_F(CommandErrors, Arguments) {
  ExpectError({}, kUsage, {"ubcommand"});
  ExpectError({"frobnicate"}, kUsage, {"frobnicate"});
  ExpectError({"map"}, kUsage, {"--out"});
  ExpectError({"map", "--out", out_}, kUsage, {"SEQ", "--load"});
  ExpectError({"map", scene_}, kUsage, {"--out"});
  ExpectError({"map", scene_, "--out", out_, "--bogus"}, kUsage, {"--bogus"});
  ExpectError({"compare", scene_, "--out", out_, "--bogus", "1"}, kUsage, {"--bogus"});
  ExpectError({"generate", scene_, "--out"}, kUsage, {"--out"});
  ExpectError({"map", scene_, "--out", out_, "--method", "voxels"}, kUsage,
              {"voxels", "tsdf++/anchored"});
  ExpectError({"map", scene_, "--out", out_, "--profile", "thin"}, kUsage,
              {"thin", "paper", "close"});
  ExpectError({"map", scene_, "--out", out_, "--poses", "vicon"}, kUsage, {"vicon", "gt", "icp"});
  ExpectError({"map", scene_, "--out", out_, "--segmentation", "net"}, kUsage,
              {"net", "gt, none, depth"});
  ExpectError({"map", scene_, "--out", out_, "--layers", "0"}, kUsage, {"--layers", "0"});
  ExpectError({"map", scene_, "--out", out_, "--layers", "3", "--method", "tsdf"}, kUsage,
              {"--layers", "3", "tsdf"});
  ExpectError({"map", scene_, "--out", out_, "--voxel", "-0.01"}, kUsage, {"voxel", "-0.01"});
  ExpectError({"map", scene_, "--out", out_, "--voxel", "wide"}, kUsage, {"--voxel", "wide"});
  ExpectError({"map", scene_, "--out", out_, "--trunc-front", "0"}, kUsage, {"--trunc-front", "0"});
  ExpectError({"map", scene_, "--out", out_, "--threads", "0"}, kUsage, {"--threads", "0"});
  ExpectError({"map", scene_, "--out", out_, "--until", "2.5"}, kUsage, {"--until", "2.5"});
  ExpectError({"compare", scene_, "--out", out_, "--methods", "tsdf,voxels"}, kUsage, {"voxels"});
  ExpectError({"compare", scene_, "--out", out_, "--methods", ","}, kUsage, {"--methods"});
  ExpectError({"compare", scene_, "--out", out_, "--profiles", "paper,thin"}, kUsage, {"thin"});
  ExpectError({"compare", scene_, "--out", out_, "--every", "0"}, kUsage, {"--every", "0"});
}

TEST_F(CommandErrors, WhatGenerateWouldIgnoreOrCouldNotReadAgain) {
  ExpectError({"generate", scene_, "--out", out_, "--seed", "-1"}, 2, {"--seed", "-1"});
  ExpectError({"generate", "--list", scene_}, 2, {"--list"});
  ExpectError({"generate", "--list", "--page", out_}, 2, {"--list", "--page"});
  const std::vector<std::vector<std::string>> of_rendering{
      {"--seed", "1"}, {"--scale", "1"}, {"--sensor", "kinect"}, {"--share", "0"},
      {"--jobs", "2"}, {"--overwrite"},  {"--no-antialias"}};
  for (const auto& option : of_rendering) {
    std::vector<std::string> list{"generate", "--list"};
    list.insert(list.end(), option.begin(), option.end());
    ExpectError(list, 2, {option.front() + " has no effect beside --list"});
    std::vector<std::string> page{"generate", "--page", out_};
    page.insert(page.end(), option.begin(), option.end());
    ExpectError(page, 2, {option.front() + " has no effect beside --page"});
    EXPECT_FALSE(std::filesystem::exists(out_)) << option.front();
  }
}

TEST_F(CommandErrors, ASequenceIsNoPlaceForResults) {
  const std::string sequence = Generate();
  const std::vector<std::string> before = Below(sequence);
  ExpectError({"map", sequence, "--out", sequence}, 2, {sequence, "is a sequence"});
  ExpectError({"compare", sequence, "--out", sequence}, 2, {sequence, "is a sequence"});
  EXPECT_EQ(Below(sequence), before);
}

TEST_F(CommandErrors, MissingScene) {
  for (const char* command : {"generate", "map", "compare"}) {
    ExpectError({command, folder_ / "none.toml", "--out", out_}, kUsage, {"none.toml"});
  }
  ExpectError({"map", folder_ / "none", "--out", out_}, kUsage, {"none", "no such"});
  // A folder that is no sequence.
  fs::create_directories(folder_ / "empty");
  ExpectError({"map", folder_ / "empty", "--out", out_}, kData, {"empty"});
}

TEST_F(CommandErrors, BrokenScene) {
  const std::string text = kTinyScene;
  Write(scene_, text + "[[object\n");
  for (const char* command : {"generate", "map", "compare"}) {
    ExpectError({command, scene_, "--out", out_}, kUsage, {"tiny.toml"});
  }
  Write(scene_, "colour = \"red\"\n" + text);
  for (const char* command : {"generate", "map", "compare"}) {
    ExpectError({command, scene_, "--out", out_}, kUsage, {"tiny.toml", "colour"});
  }
  Write(scene_, text + "weight = 3\n");  // in [[object]]
  ExpectError({"generate", scene_, "--out", out_}, kUsage, {"tiny.toml", "weight"});
  Write(scene_, "");
  ExpectError({"generate", scene_, "--out", out_}, kUsage, {"tiny.toml"});
}

TEST_F(CommandErrors, FrameOrObjectThatIsNotThere) {
  ExpectError({"map", scene_, "--out", out_, "--until", "5"}, kUsage, {"--until 5", "1 to 4"});
  ExpectError({"map", scene_, "--out", out_, "--until", "0"}, kUsage, {"--until 0", "1 to 4"});
  ExpectError({"map", scene_, "--out", out_, "--until", "-3"}, kUsage, {"--until", "-3"});
  ExpectError({"compare", scene_, "--out", out_, "--until", "5"}, kUsage, {"--until 5", "1 to 4"});
  ExpectError({"compare", scene_, "--out", out_, "--until", "soon"}, kUsage, {"--until", "soon"});
  ExpectError({"map", scene_, "--out", out_, "--remove", "1,dragon"}, kUsage, {"dragon", "mug"});
  ExpectError({"map", scene_, "--out", out_, "--remove", "7"}, kUsage, {"7", "mug"});
}

TEST_F(CommandErrors, UnusableImages) {
  const fs::path sequence = Generate();
  // The first frames are sound, so the fault is met on the way.
  const auto damage = [&](const fs::path& file, const std::string& bytes) {
    const std::string sound = ReadFile(sequence / file).value();
    Write(sequence / file, bytes);
    for (const char* command : {"map", "compare"}) {
      ExpectError({command, sequence, "--out", out_}, kData, {file.filename()});
    }
    Write(sequence / file, sound);
  };
  damage("colour/Color0003.png", "no image");
  damage("mask_id/Mask0004.png", "");
  const std::string mask = ReadFile(sequence / "mask_id/Mask0003.png").value();
  damage("mask_id/Mask0003.png", mask.substr(0, mask.size() / 2));
  damage("depth_original/Depth0003.exr", "no image");
  const std::string depth = ReadFile(sequence / "depth_original/Depth0003.exr").value();
  damage("depth_original/Depth0003.exr", depth.substr(0, depth.size() / 2));

  std::vector<unsigned char> small;
  ASSERT_TRUE(cv::imencode(".png", cv::Mat(24, 32, CV_8UC3, cv::Scalar(1, 2, 3)), small));
  damage("colour/Color0002.png", std::string(small.begin(), small.end()));
  ASSERT_TRUE(cv::imencode(".png", cv::Mat(24, 32, CV_8UC1, cv::Scalar(0)), small));
  damage("mask_id/Mask0002.png", std::string(small.begin(), small.end()));

  fs::remove(sequence / "mask_id/Mask0003.png");
  ExpectError({"map", sequence, "--out", out_}, kData, {"Mask0003.png"});
}

TEST_F(CommandErrors, NoOpenGl) {
  for (const char* command : {"generate", "map", "compare"}) {
    ExpectError({command, scene_, "--out", out_}, kUsage, {"MUJOCO_GL", "nonsense"},
                {{"MUJOCO_GL", "nonsense"}});
  }
  // A machine without the libraries: the loader finds files of that name that are none.
  fs::create_directories(folder_ / "lib");
  for (const char* name : {"libEGL.so.1", "libOSMesa.so.8"}) {
    Write(folder_ / "lib" / name, std::string(4096, 'x'));
  }
  for (const auto& [backend, library] :
       {std::pair<std::string, std::string>{"egl", "libEGL.so.1"}, {"osmesa", "libOSMesa.so.8"}}) {
    for (const char* command : {"generate", "map", "compare"}) {
      ExpectError({command, scene_, "--out", out_}, kEnvironment, {library, "install"},
                  {{"MUJOCO_GL", backend}, {"LD_LIBRARY_PATH", (folder_ / "lib").string()}});
    }
  }
}

// A sequence on disk needs no OpenGL.
TEST_F(CommandErrors, MapsASequenceWithoutOpenGl) {
  const std::string sequence = Generate();
  const CommandOutput output =
      RunTsdfpp({"map", sequence, "--out", out_}, folder_.path(), {{"MUJOCO_GL", "nonsense"}});
  EXPECT_EQ(output.exit_code, 0) << output.err;
  EXPECT_EQ(output.err, "");
}

// Below a regular file no folder can be made, not even by root.
TEST_F(CommandErrors, UnwritableOutput) {
  Write(folder_ / "file", "kept");
  for (const char* command : {"generate", "map", "compare"}) {
    ExpectError({command, scene_, "--out", folder_ / "file/out"}, kEnvironment, {"file"});
    EXPECT_EQ(ReadFile(folder_ / "file"), "kept") << command;
  }
  for (const char* command : {"map", "compare"}) {
    ExpectError({command, scene_, "--out", folder_ / "file"}, kEnvironment, {"file"});
    EXPECT_EQ(ReadFile(folder_ / "file"), "kept") << command;
  }
  // Someone else's folder is not a place for a sequence.
  fs::create_directories(folder_ / "mine");
  Write(folder_ / "mine/letter.txt", "kept");
  ExpectError({"generate", scene_, "--out", folder_ / "mine"}, kUsage, {"mine"});
  ExpectError({"generate", scene_, "--out", folder_ / "mine", "--overwrite"}, kUsage, {"mine"});
  EXPECT_EQ(ReadFile(folder_ / "mine/letter.txt"), "kept");
}

// What is in no set of ours would be gone with it.
TEST_F(CommandErrors, OverwriteTakesNothingElse) {
  const auto generate = [&] {
    return test::RunTsdfpp({"generate", scene_, "--out", folder_ / "set", "--overwrite"},
                           folder_.path());
  };
  ASSERT_EQ(generate().exit_code, 0);
  ASSERT_EQ(generate().exit_code, 0);
  for (const char* file : {"letter.txt", "depth_original/mine.exr", "map/mesh/scene.ply"}) {
    fs::create_directories((folder_ / "set" / file).parent_path());
    Write(folder_ / "set" / file, "kept");
    ExpectError({"generate", scene_, "--out", folder_ / "set", "--overwrite"}, kUsage,
                {file, "is no file of the sequence and would be gone"});
    EXPECT_EQ(ReadFile(folder_ / "set" / file), "kept");
    fs::remove(folder_ / "set" / file);
  }
}

// Files that no run of ours left, by the names that one would write.
TEST_F(CommandErrors, ARunReplacesNothingOfOthers) {
  const auto kept = [&](const std::string& command, const std::vector<std::string>& files) {
    for (const std::string& file : files) {
      fs::create_directories((folder_ / "theirs" / file).parent_path());
      Write(folder_ / "theirs" / file, "kept");
      ExpectError({command, scene_, "--out", folder_ / "theirs"}, kUsage,
                  {file, "is of no earlier run and would be replaced"});
      EXPECT_EQ(ReadFile(folder_ / "theirs" / file), "kept");
      fs::remove_all(folder_ / "theirs");
    }
  };
  kept("map", {"stats.json", "mesh/scene.ply", "mesh/background-0.ply", "trajectories/mug-1.txt"});
  kept("compare", {"summary.json", "report.html"});
  // Another name stays, and so does a file of the run's own.
  fs::create_directories(folder_ / "theirs/mesh");
  Write(folder_ / "theirs/mesh/notes.txt", "kept");
  for (int i = 0; i < 2; ++i) {
    EXPECT_EQ(
        test::RunTsdfpp({"map", scene_, "--out", folder_ / "theirs"}, folder_.path()).exit_code, 0);
  }
  EXPECT_EQ(ReadFile(folder_ / "theirs/mesh/notes.txt"), "kept");
}

TEST_F(CommandErrors, ASavedMapReplacesNothingThatIsRead) {
  ASSERT_EQ(
      test::RunTsdfpp({"generate", scene_, "--out", folder_ / "set"}, folder_.path()).exit_code, 0);
  Write(folder_ / "votes.toml", "");
  const std::string listed = ReadFile(folder_ / "set/sequence.json").value();
  for (const fs::path& save :
       {folder_ / "set/sequence.json", folder_ / "set/new.map", folder_ / "votes.toml"}) {
    ExpectError({"map", folder_ / "set", "--associate", "votes", "--poses", "track",
                 "--vote-config", folder_ / "votes.toml", "--out", folder_ / "out", "--save", save},
                kUsage, {save.string(), "which is read"});
  }
  EXPECT_EQ(ReadFile(folder_ / "set/sequence.json"), listed);
  EXPECT_EQ(ReadFile(folder_ / "votes.toml"), "");
}

TEST_F(CommandErrors, WhatWouldBeOfNoUseIsSaid) {
  ExpectError({"evaluate", scene_, "--meshes", folder_.path(), "--at", "2", "--removed", ","},
              kUsage, {"--removed ',' names no object"});
  ExpectError({"compare", scene_, "--removed", ",", "--out", folder_ / "out"}, kUsage,
              {"--removed ',' names no object"});
  ExpectError({"compare", scene_, "--until", "2", "--reveal", "3", "--out", folder_ / "out"},
              kUsage, {"--reveal 3 is after --until 2"});
  ASSERT_EQ(
      test::RunTsdfpp({"map", scene_, "--out", folder_ / "mapped", "--save", folder_ / "whole.map"},
                      folder_.path())
          .exit_code,
      0);
  ExpectError({"map", scene_, "--load", folder_ / "whole.map", "--out", folder_ / "out"}, kUsage,
              {"whole.map goes to frame", "has none after it"});
}

}  // namespace
}  // namespace tsdfpp
