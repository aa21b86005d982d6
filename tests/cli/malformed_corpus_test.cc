// A corpus of malformed scenes and data, each given to the command as a user would: one sentence
// that names the file, the right exit code, nothing written. Run under ASan: scripts/sanitizers.sh.
// (The rooms' own tests look at many more, one reader each.)
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>

#include "core/files.h"
#include "tests/cli/run_command.h"
#include "tests/core/temp_folder.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;
using test::kData;
using test::kUsage;
using test::RunTsdfpp;

const char* const kScene = R"(name = "tiny"
purpose = "To be spoilt."
frames = 3
rate_hz = 10
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
name = "thing"
id = 1
class = "thing"
model = "mug"
x = 0.0
y = 0.0
)";

std::string With(const std::string& from, const std::string& to) {
  std::string text = kScene;
  const std::size_t at = text.find(from);
  EXPECT_NE(at, text.npos) << from;
  return text.replace(at, from.size(), to);
}

// A file's bytes and what the sentence says beside its name.
struct Broken {
  std::string bytes;
  std::string words;
  int exit_code = kData;
};

class MalformedCorpus : public testing::Test {
 protected:
  // A sequence of the tiny scene, and exports of it.
  static void SetUpTestSuite() {
    original_ = fs::path(testing::TempDir()) / fmt::format("tsdfpp-corpus-{}", getpid());
    fs::create_directories(original_);
    ASSERT_TRUE(WriteFile(original_ / "scene.toml", kScene).has_value());
    const auto run = [&](const std::vector<std::string>& words) {
      const auto output = RunTsdfpp(words, original_);
      ASSERT_EQ(output.exit_code, 0) << output.err;
    };
    run({"generate", original_ / "scene.toml", "--out", original_ / "set", "--jobs", "1"});
    for (const std::string format : {"klg", "tum"}) {
      run({"export", original_ / "set", "--to", format, "--out", original_ / format});
    }
  }
  static void TearDownTestSuite() { fs::remove_all(original_); }

  void Toml();
  void Mjcf();
  void Meshes();
  void Trajectories();
  void Images();
  void Klg();

  void Refuse(const std::string& kind, const std::vector<std::string>& words,
              const std::string& file, const Broken& broken) {
    ++counts_[kind];
    SCOPED_TRACE(kind + ", " + file + ": " + broken.words);
    std::vector<std::string> arguments = words;
    arguments.insert(arguments.end(), {"--out", folder_ / "out"});
    const auto output = RunTsdfpp(arguments, folder_.path());
    EXPECT_EQ(output.exit_code, broken.exit_code) << output.err;
    EXPECT_EQ(output.out, "");
    EXPECT_EQ(std::count(output.err.begin(), output.err.end(), '\n'), 1) << output.err;
    EXPECT_TRUE(output.err.starts_with("tsdfpp: ")) << output.err;
    EXPECT_NE(output.err.find(file), std::string::npos) << output.err;
    EXPECT_NE(output.err.find(broken.words), std::string::npos) << output.err;
    EXPECT_FALSE(fs::exists(folder_ / "out") && !fs::is_empty(folder_ / "out"));
    fs::remove_all(folder_ / "out");
  }
  // The scene, which names `file`, is refused with each of these bytes in it.
  void RefuseScenes(const std::string& kind, const std::string& scene, const std::string& file,
                    const std::vector<Broken>& corpus) {
    ASSERT_TRUE(WriteFile(folder_ / "scene.toml", scene).has_value());
    for (const Broken& broken : corpus) {
      ASSERT_TRUE(WriteFile(folder_ / file, broken.bytes).has_value());
      Refuse(kind, {"generate", folder_ / "scene.toml"}, file, broken);
    }
  }
  // A copy of a sound set, spoilt.
  void RefuseSets(const std::string& kind, const std::string& set, const std::string& file,
                  const std::vector<Broken>& corpus) {
    for (const Broken& broken : corpus) {
      fs::remove_all(folder_ / "set");
      fs::copy(original_ / set, folder_ / "set", fs::copy_options::recursive);
      ASSERT_TRUE(fs::exists(folder_ / "set" / file)) << file;
      ASSERT_TRUE(WriteFile(folder_ / "set" / file, broken.bytes).has_value());
      Refuse(kind, {"export", folder_ / "set", "--to", "bop"}, fs::path(file).filename(), broken);
    }
  }
  static std::string Sound(const std::string& file) { return ReadFile(original_ / file).value(); }
  static std::string Cut(const std::string& file, double share) {
    const std::string bytes = Sound(file);
    return bytes.substr(0, static_cast<std::size_t>(share * static_cast<double>(bytes.size())));
  }
  static std::string Changed(const std::string& file, std::size_t at, const std::string& bytes) {
    return Sound(file).replace(at, bytes.size(), bytes);
  }

  static fs::path original_;
  std::map<std::string, int> counts_;  // by kind
  test::TempFolder folder_;
};
fs::path MalformedCorpus::original_;

void MalformedCorpus::Toml() {
  RefuseScenes(
      "TOML", "", "scene.toml",
      {{"", "'name' is missing", kUsage},
       {std::string("\0\1\2\xff", 4), "not valid TOML", kUsage},
       {"\xff\xfe n", "not valid TOML", kUsage},
       {std::string(kScene).substr(0, 100), "not valid TOML", kUsage},
       {std::string(kScene) + "[[object\n", "not valid TOML", kUsage},
       {std::string(20000, '['), "tables and lists within one another, over the limit", kUsage},
       {std::string(kScene) + "name = \"again\"\n", "not valid TOML", kUsage},
       {With("frames = 3", "frames = 3e300"), "'frames'", kUsage},
       {With("frames = 3", "frames = 9223372036854775807"), "'frames'", kUsage},
       {With("rate_hz = 10", "rate_hz = nan"), "'rate_hz'", kUsage},
       {With("width = 64", "width = -64"), "'camera.width'", kUsage},
       {With("f = 50.0", "f = inf"), "'camera.f'", kUsage},
       {With("target = [0.0, 0.0, 0.74]", "target = [0.0]"), "'camera.target'", kUsage},
       {With("id = 1", "id = 1e9"), "'object[0].id'", kUsage},
       {With("model = \"mug\"", "model = [\"mug\"]"), "'object[0].model'", kUsage},
       {With("name = \"thing\"", "name = \"../thing\""), "'object[0].name'", kUsage}});
}

// There is no reader for MJCF: a scene is composed by the program itself.
void MalformedCorpus::Mjcf() {
  const std::string mjcf = "<mujoco><worldbody><geom size=\"1\"/></worldbody></mujoco>\n";
  RefuseScenes("MJCF", mjcf, "scene.toml", {{mjcf, "not valid TOML", kUsage}});
  ASSERT_TRUE(WriteFile(folder_ / "robot.xml", mjcf).has_value());
  Refuse("MJCF", {"generate", folder_ / "robot.xml"}, "robot.xml", {mjcf, "MJCF", kUsage});
  RefuseScenes("MJCF", With("model = \"mug\"", "model = \"robot.xml\""), "robot.xml",
               {{mjcf, "expected one of", kUsage}});
}

void MalformedCorpus::Meshes() {
  const auto named = [](const std::string& file) {
    return With("model = \"mug\"", "model = \"" + file + "\"");
  };
  const std::string square = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";
  RefuseScenes("meshes", named("a.obj"), "a.obj",
               {{"", "is empty"},
                {square, "is empty"},
                {square + "f 1 2 9\n", "names vertex 9"},
                {square + "f 1 2 -9\n", "names vertex -9"},
                {square + "f 1 2 99999999999999999999\n", "is no index"},
                {"v 0 0 nan\n", "not a finite number"},
                {std::string("v 0 0 0\n\0\1\2", 11), "not text"},
                {square + "f 1 2 \\", "cut off"},
                {"v 0 0 0\nv 900 0 0\nv 0 9 0\nf 1 2 3\n", "expected a longest side", kUsage}});
  std::string vast(84, '\0');
  vast.replace(80, 4, "\xff\xff\xff\x7f");
  RefuseScenes("meshes", named("a.stl"), "a.stl",
               {{"", "not an STL file"},
                {vast, "cut off"},
                {"solid\nfacet\nvertex 0 0 o\nendfacet\nendsolid\n", "is not a number"}});
  const std::string ply =
      "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty "
      "float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n";
  const auto header = [&](const std::string& count) {
    std::string text = ply;
    return text.replace(text.find("{}"), 2, count);
  };
  RefuseScenes("meshes", named("a.ply"), "a.ply",
               {{"plywood", "not a PLY file"},
                {header("3") + "0 0 0\n1 0 0\n", "the file ends"},
                {header("-3") + "0 0 0\n", ""},
                {header("99999999999") + "0 0 0\n", ""},
                {header("3") + "0 0 0\n1 0 0\n0 1 0\n3 0 1 7\n", "does not have"}});
}

void MalformedCorpus::Trajectories() {
  std::string scene = kScene;
  const std::size_t first = scene.find("target =");
  scene.replace(first, scene.find("[[object]]") - first,
                "path = \"recorded\"\nfile = \"path.txt\"\nposition = [0.0, -1.2, 1.5]\ntarget = "
                "[0.0, 0.0, 0.74]\n");
  RefuseScenes("trajectories", scene, "path.txt",
               {{"", ""},
                {"0 0 0 0 0 0 0 1\n", ""},
                {"0 0 0 0 0 0 0 1\n1 0 0\n", "path.txt:2"},
                {"0 0 0 0 0 0 0 1\n1 nan 0 0 0 0 0 1\n", "path.txt:2"},
                {"0 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 0\n", "path.txt:2"},
                {"1 0 0 0 0 0 0 1\n0 0 0 0 0 0 0 1\n", "path.txt:2"},
                {"0 0 0 0 0 0 0 1\n0.05 0 0 0 0 0 0 1\n", "lasts"},
                {std::string("\0\xff\0", 3), "path.txt:1"}});
  RefuseSets("trajectories", "tum", "groundtruth.txt",
             {{"", ""},
              {"0 1 2\n", "groundtruth.txt"},
              {"x 0 0 0 0 0 0 1\n", "groundtruth.txt"},
              {"0 0 0 0 9 9 9 9\n", "groundtruth.txt"}});
  RefuseSets("trajectories", "set", "trajectories/gt-cam-0.txt",
             {{"", ""}, {"1 0 0 inf 0 0 0 1\n", ""}, {"one 0 0 0 0 0 0 1\n", ""}});
}

void MalformedCorpus::Images() {
  const std::string depth = "depth_original/Depth0002.exr";
  RefuseSets("images", "set", depth,
             {{"", ""},
              {Cut("set/" + depth, 0.5), ""},
              {Cut("set/" + depth, 0.02), ""},
              {Sound("set/colour/Color0002.png"), ""}});
  const std::string colour = "colour/Color0002.png";
  RefuseSets("images", "set", colour,
             {{"no image", ""},
              {Cut("set/" + colour, 0.5), ""},
              // The header says 2^31 - 1 columns.
              {Changed("set/" + colour, 16, std::string("\x7f\xff\xff\xff", 4)), ""},
              {Sound("set/mask_id/Mask0002.png"), ""}});
  const std::string mask = "mask_id/Mask0002.png";
  RefuseSets("images", "set", mask,
             {{Cut("set/" + mask, 0.3), ""}, {Sound("set/colour/Color0002.png"), ""}});
}

void MalformedCorpus::Klg() {
  const std::string klg = "klg/" + std::string("sequence.klg");
  std::vector<Broken> corpus{{"", "0 bytes"},
                             {"ab", "2 bytes"},
                             {Changed(klg, 0, std::string(4, '\0')), "frame count is 0"},
                             {Changed(klg, 0, "\xff\xff\xff\x7f"), ""},
                             {Changed(klg, 12, "\xff\xff\xff\xff"), "bytes of depth"},
                             {Changed(klg, 20, "not what zlib wrote"), "cannot be unpacked"}};
  for (const double share : {0.001, 0.2, 0.34, 0.66, 0.999}) {
    corpus.push_back({Cut(klg, share), "cut short"});
  }
  RefuseSets("klg", "klg", "sequence.klg", corpus);
}

TEST_F(MalformedCorpus, EveryFileGetsItsSentence) {
  Toml();
  Mjcf();
  Meshes();
  Trajectories();
  Images();
  Klg();
  int all = 0;
  for (const auto& [kind, count] : counts_) {
    std::printf("malformed %s: %d\n", kind.c_str(), count);
    all += count;
  }
  std::printf("malformed files given to the command: %d\n", all);
  EXPECT_GE(all, 40);
}

}  // namespace
}  // namespace tsdfpp
