// What is read, and what is somebody else's, is not written over, however it is spelled.
#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <vector>

#include "core/files.h"
#include "sequence/export.h"
#include "tests/cli/run_command.h"
#include "tests/core/temp_folder.h"
#include "tests/eval/tiny_scene.h"
#include "tests/sequence/box_source.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;
using test::CommandOutput;
using test::kUsage;

class KeptFiles : public testing::Test {
 protected:
  void SetUp() override {
    before_ = fs::current_path();
    fs::current_path(folder_.path());
  }
  void TearDown() override { fs::current_path(before_); }

  fs::path Export(DatasetFormat format) {
    test::BoxSource source(4);
    fs::path place = folder_ / DatasetFormatName(format);
    const auto exported = ExportSequence(source, format, place);
    EXPECT_TRUE(exported.has_value()) << exported.error().message;
    return place;
  }
  void Write(const fs::path& file) {
    ASSERT_TRUE(WriteFile(folder_ / file.string(), "kept").has_value());
  }
  // Two sequences, of which one is no file of the benchmark's folder.
  void WriteBenchmark() {
    std::string text =
        "name = \"s\"\nscale = 1\nvoxel_m = 0.02\ntrunc_front = 10\ntrunc_back = 3\n"
        "metrics = [\"visible_completion\"]\n";
    for (const char* scene : {"a.toml", "../../elsewhere.toml"}) {
      text += "[[sequence]]\nname = \"" + std::string(scene) + "\"\nscene = \"" + scene +
              "\"\nscene_hash = \"?\"\ntruth_hash = \"?\"\n";
    }
    ASSERT_TRUE(WriteFile(folder_ / "sets/s/set.toml", text).has_value());
  }
  void ExpectRefused(const std::vector<std::string>& arguments, const std::string& words) {
    const CommandOutput run = test::RunTsdfpp(arguments, folder_.path());
    EXPECT_EQ(run.exit_code, kUsage) << arguments.back() << run.err;
    EXPECT_NE(run.err.find(words), std::string::npos) << arguments.back() << ": " << run.err;
  }
  // `read` is the sequence or scene, with the options that it needs.
  void ExpectSaveRefused(std::vector<std::string> read, const fs::path& save) {
    read.insert(read.begin(), "map");
    read.insert(read.end(), {"--out", folder_ / "out", "--save", save});
    ExpectRefused(read, "which is read, expected another place");
  }
  void ExpectSegmentsRefused(const fs::path& sequence, const fs::path& out) {
    ExpectRefused({"segment", sequence, "--segmentation", "depth", "--out", out},
                  "which is read, expected a folder outside");
  }

  test::TempFolder folder_;
  fs::path before_;
};

TEST_F(KeptFiles, ASavedMapIsNoFileOfANewRun) {
  const fs::path recording = Export(DatasetFormat::kTum);
  const std::string here = fs::current_path();
  const auto refused = [&](const std::string& out, const std::string& save) {
    ExpectRefused({"map", recording, "--until", "1", "--out", out, "--save", save},
                  "is a place of what --out '" + out + "' gets");
    EXPECT_FALSE(fs::exists("new")) << out << " " << save;
  };
  refused("new", here + "/new/stats.json");
  refused(here + "/new", "new/run.json");
  refused("./new", "new/mesh/a.map");
  refused("new", "./new/views/a.map");
  refused("new", "new/stats.json");
}

TEST_F(KeptFiles, TheWorkingFolderMayBeWhatIsRead) {
  const fs::path recording = Export(DatasetFormat::kTum);
  fs::current_path(recording);
  ExpectSaveRefused({"."}, "new.map");
  ExpectSegmentsRefused(".", "new");
}

TEST_F(KeptFiles, OfWhatLiesBesideAKlg) {
  const fs::path folder = Export(DatasetFormat::kKlg);
  const std::string file = folder / "sequence.klg";
  const std::string poses = ReadFile(folder / "groundtruth.txt").value();
  for (const char* save :
       {"groundtruth.txt", "calibration.txt", "mask/000000.png", "masks/new.map", "sequence.klg"}) {
    ExpectSaveRefused({file}, folder / save);
  }
  EXPECT_EQ(ReadFile(folder / "groundtruth.txt"), poses);
  fs::remove_all(folder / "mask");
  ExpectSegmentsRefused(file, folder / "mask");
  ExpectSegmentsRefused(file, folder / "masks");
  // Other things may lie in the same folder.
  const CommandOutput beside =
      test::RunTsdfpp({"segment", file, "--out", folder / "segments"}, folder_.path());
  EXPECT_EQ(beside.exit_code, 0) << beside.err;
}

TEST_F(KeptFiles, OfTheDatasetsOfBopAndReplica) {
  const fs::path bop = Export(DatasetFormat::kBop);
  ExpectSaveRefused({bop / "test/000000"}, bop / "models/obj_000003.ply");
  ExpectSegmentsRefused(bop / "test/000000", bop / "models/new");
  fs::current_path(bop / "test/000000");
  ExpectSaveRefused({"."}, bop / "models/obj_000003.ply");
  Write("replica/room/traj.txt");
  Write("replica/cam_params.json");
  ExpectSaveRefused({folder_ / "replica/room"}, folder_ / "replica/cam_params.json");
}

TEST_F(KeptFiles, OfTheFilesOfASceneAndANetwork) {
  const std::string object =
      "[[object]]\nname = \"tent\"\nid = 3\nclass = \"tent\"\nmodel = \"meshes/tent.obj\"\n"
      "scale = 0.05\nx = -0.3\ny = -0.25\n";
  const std::string mesh =
      "mtllib tent.mtl\nusemtl red\nv -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nv 0 0 1\nf 4 3 2 1\n"
      "f 1 2 5\nf 2 3 5\nf 3 4 5\nf 4 1 5\n";
  ASSERT_TRUE(WriteFile(folder_ / "scene.toml", test::TinyScene(3) + object).has_value());
  ASSERT_TRUE(WriteFile(folder_ / "meshes/tent.obj", mesh).has_value());
  ASSERT_TRUE(WriteFile(folder_ / "meshes/tent.mtl", "newmtl red\nKd 0.9 0.1 0.1\n").has_value());
  for (const char* save : {"scene.toml", "meshes/tent.obj", "meshes/tent.mtl"}) {
    ExpectSaveRefused({"scene.toml"}, save);
  }
  EXPECT_EQ(ReadFile(folder_ / "meshes/tent.obj"), mesh);
  ASSERT_TRUE(WriteFile(folder_ / "net.toml", "graph = \"other.pbtxt\"\n").has_value());
  for (const char* file : {"net.pb", "net.pbtxt", "other.pbtxt"}) Write(file);
  for (const char* save : {"net.pbtxt", "other.pbtxt"}) {
    ExpectSaveRefused({"scene.toml", "--segmentation", "network", "--model", "net.pb",
                       "--network-config", "net.toml"},
                      save);
  }
}

// Its folder is frozen, and a page is none of the results that it is made of.
TEST_F(KeptFiles, OfABenchmarkAndItsResults) {
  WriteBenchmark();
  const fs::path set = folder_ / "sets/s";
  for (const char* file : {"sets/s/a.toml", "elsewhere.toml", "result.txt"}) Write(file);
  fs::create_directories(folder_ / "results");
  fs::create_symlink(folder_ / "result.txt", folder_ / "results/link.json");
  fs::create_directory_symlink(set, folder_ / "to-set");
  fs::create_directory_symlink(folder_ / "results", folder_ / "to-results");
  const std::string text = ReadFile(set / "set.toml").value();
  const auto refused = [&](const std::string& option, const std::string& of, const fs::path& out,
                           const std::string& words) {
    ExpectRefused({"bench-set", "s", "--sets", "sets", option, of, "--out", out}, words);
  };
  for (const char* page : {"sets/s/set.toml", "sets/s/a.toml", "sets/s/new.md", "sets/s/../s/x",
                           "to-set/a.toml", "elsewhere.toml"}) {
    refused("--leaderboard", "results", page, "which is read, expected another place");
  }
  for (const char* out : {"sets/s", "sets/s/new", "to-set"}) {
    refused("--run", "tsdf", out, "which is read, expected another place");
  }
  for (const char* page : {"results/new.json", "to-results/new.json", "./results/../results/n.json",
                           "results/link.json", "result.txt"}) {
    refused("--leaderboard", "results", page, "would be one of the results of 'results'");
  }
  EXPECT_EQ(ReadFile(set / "set.toml"), text);
  for (const char* file : {"sets/s/a.toml", "elsewhere.toml", "result.txt"}) {
    EXPECT_EQ(ReadFile(folder_ / file), "kept") << file;
  }
}

// Of somebody else's; what a run left it may replace.
TEST_F(KeptFiles, OfThePlaceOfAPageOfScenes) {
  ASSERT_TRUE(WriteFile(folder_ / "scenes/a.toml", test::TinyScene(3)).has_value());
  const std::vector<std::string> make{"generate", "--page", "page", "--scenes", "scenes"};
  Write("page/scenes.md");
  ExpectRefused(make, "page/scenes.md: is no page of generate --page and would be replaced");
  EXPECT_EQ(ReadFile(folder_ / "page/scenes.md"), "kept");
  fs::remove(folder_ / "page/scenes.md");
  fs::create_directories(folder_ / "elsewhere");
  for (const char* link : {"page/pictures", "page/pictures/scenes"}) {
    fs::create_directories((folder_ / link).parent_path());
    fs::create_directory_symlink(folder_ / "elsewhere", folder_ / link);
    ExpectRefused(make, std::string(link) + ": is a link, expected a folder or nothing");
    EXPECT_TRUE(fs::is_empty(folder_ / "elsewhere"));
    fs::remove(folder_ / link);
  }
  // Its own page is made anew.
  for (int i = 0; i < 2; ++i) {
    const CommandOutput run = test::RunTsdfpp(make, folder_.path());
    EXPECT_EQ(run.exit_code, 0) << run.err;
    EXPECT_TRUE(fs::exists(folder_ / "page/pictures/scenes/tiny.jpg"));
  }
  ASSERT_TRUE(WriteFile(folder_ / "scenes/b.toml", test::TinyScene(4)).has_value());
  ExpectRefused(make, "scenes/b.toml: 'name' is 'tiny', as in scenes/a.toml, expected another");
}

TEST_F(KeptFiles, PicturesOfViews) {
  const fs::path recording = Export(DatasetFormat::kTum);
  for (const char* file : {"colour-1.png", "depth-1.exr", "normal-2.png", "id-2.png"}) {
    Write(fs::path("theirs/views") / file);
    ExpectRefused({"map", recording, "--until", "1", "--views", "2", "--out", folder_ / "theirs"},
                  std::string(file) + ": is of no earlier run and would be replaced");
    EXPECT_EQ(ReadFile(folder_ / "theirs/views" / file), "kept");
    fs::remove_all(folder_ / "theirs");
  }
  for (int i = 0; i < 2; ++i) {
    const CommandOutput run = test::RunTsdfpp({"map", recording, "--until", "1", "--voxel", "0.02",
                                               "--views", "2", "--out", folder_ / "ours"},
                                              folder_.path());
    EXPECT_EQ(run.exit_code, 0) << run.err;
  }
  EXPECT_TRUE(fs::exists(folder_ / "ours/views/id-2.png"));
}

}  // namespace
}  // namespace tsdfpp
