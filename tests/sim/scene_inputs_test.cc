// The files that a scene is made of, collected so that it can be made elsewhere.
#include "sim/scene/scene_inputs.h"

#include <gtest/gtest.h>

#include "core/files.h"
#include "sim/load_scene.h"
#include "tests/core/temp_folder.h"
#include "tests/sim/mesh_texts.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;
using Files = std::map<std::string, fs::path>;

const char* const kMeshScene = R"(name = "meshes"
purpose = "Meshes of one name, with companions in other folders."
frames = 2
rate_hz = 10
[camera]
width = 64
height = 48
f = 50.0
cx = 32
cy = 24
path = "recorded"
file = "paths/cube.obj.txt"
position = [0.0, -1.0, 1.3]
target = [0.0, 0.0, 0.8]
)";

std::string Object(int id, const std::string& model, const std::string& more = "") {
  return fmt::format(
      "[[object]]\nname = \"o{0}\"\nid = {0}\nclass = \"cube\"\nmodel = \"{1}\"\nscale = 0.1\n"
      "x = {2}\ny = 0.0\n{3}",
      id, model, 0.15 * (id - 2), more);
}

class SceneInputFiles : public testing::Test {
 protected:
  void Write(const std::string& file, const std::string& bytes) {
    ASSERT_TRUE(WriteFile(folder_ / file, bytes).has_value());
  }
  void SetUp() override {
    Write("paths/cube.obj.txt", "0 0 0 0 0 0 0 1\n1 0.1 0 0 0 0 0 1\n");
    Write("a/cube.obj", kCube);
    Write("b/cube.obj", "mtllib ../looks/cube.mtl\nmtllib missing.mtl\nusemtl red\n" + kCube);
    Write("looks/cube.mtl", "newmtl red\nKd 1 0 0\nmap_Kd pictures/red.png\n");
    Write("looks/pictures/red.png", "no picture, but a file");
    Write("scene.toml", kMeshScene + Object(1, "a/cube.obj") + Object(2, "b/cube.obj") +
                            Object(3, "./a/cube.obj") +
                            Object(4, "a/cube.obj", "picture = \"looks/pictures/red.png\"\n"));
  }
  SceneInputs Collect(const fs::path& scene) {
    const auto config = LoadSceneConfig(scene);
    EXPECT_TRUE(config.has_value()) << config.error().message;
    const auto inputs = CollectInputs(*config);
    EXPECT_TRUE(inputs.has_value()) << inputs.error().message;
    return *inputs;
  }
  test::TempFolder folder_;
};

TEST_F(SceneInputFiles, EachHasAPlaceOfItsOwn) {
  const SceneInputs inputs = Collect(folder_ / "scene.toml");
  EXPECT_EQ(inputs.files,
            (Files{{"inputs/1/cube.obj.txt", folder_ / "paths/cube.obj.txt"},
                   {"inputs/2/cube.obj", folder_ / "a/cube.obj"},
                   {"inputs/3/b/cube.obj", folder_ / "b/cube.obj"},
                   {"inputs/3/looks/cube.mtl", folder_ / "looks/cube.mtl"},
                   {"inputs/3/looks/pictures/red.png", folder_ / "looks/pictures/red.png"},
                   {"inputs/4/red.png", folder_ / "looks/pictures/red.png"}}));
  EXPECT_EQ(inputs.config.objects[2].model.file, "inputs/2/cube.obj");
  EXPECT_EQ(SceneToToml(inputs.config).find(folder_.path().string()), std::string::npos);
}

TEST_F(SceneInputFiles, WhatWasCollectedCollectsToTheSame) {
  const SceneInputs inputs = Collect(folder_ / "scene.toml");
  const fs::path other = folder_ / "other machine";
  for (const auto& [place, file] : inputs.files) {
    ASSERT_TRUE(WriteFile(other / place, ReadFile(file).value()).has_value());
  }
  ASSERT_TRUE(WriteFile(other / "scene.toml", SceneToToml(inputs.config)).has_value());
  for (const char* gone : {"paths", "a", "b", "looks"}) fs::remove_all(folder_ / gone);
  const SceneInputs again = Collect(other / "scene.toml");
  EXPECT_EQ(SceneToToml(again.config), SceneToToml(inputs.config));
  for (const auto& [place, file] : again.files) EXPECT_EQ(file, other / place);
  EXPECT_EQ(again.files.size(), inputs.files.size());
}

// A sequence says what it is made of in UTF-8, and leads to no place outside itself.
TEST_F(SceneInputFiles, WhatCannotBeTakenAlongIsLeftOut) {
  Write("looks/\xff.mtl", "newmtl red\nKd 1 0 0\n");
  Write("b/cube.obj",
        "mtllib ../looks/\xff.mtl\nmtllib " + (folder_ / "looks/cube.mtl").string() + "\n" + kCube);
  const Files files = Collect(folder_ / "scene.toml").files;
  EXPECT_TRUE(files.contains("inputs/3/cube.obj"));
  for (const auto& [place, file] : files) EXPECT_NE(file.extension(), ".mtl") << place;
}

TEST_F(SceneInputFiles, ASceneWithoutFilesHasNone) {
  const auto config = LoadSceneConfig(TSDFPP_SOURCE_DIR "/scenes/mini.toml");
  ASSERT_TRUE(config.has_value());
  const auto inputs = CollectInputs(*config);
  ASSERT_TRUE(inputs.has_value());
  EXPECT_EQ(inputs->files, Files{});
  EXPECT_EQ(SceneToToml(inputs->config), SceneToToml(*config));
}

// A file that is not there is the scene's fault, by line.
TEST_F(SceneInputFiles, AMissingFileIsNamedWithTheScenesLine) {
  const auto fault = [&](const std::string& text) {
    Write("scene.toml", text);
    const auto config = LoadSceneConfig(folder_ / "scene.toml");
    EXPECT_FALSE(config.has_value());
    if (config) return std::string();
    EXPECT_EQ(config.error().kind, ErrorKind::kUsage);
    return config.error().message;
  };
  const std::string here = (folder_ / "scene.toml").string();
  const auto at = [&](const char* file) { return (folder_ / file).string(); };
  EXPECT_EQ(fault(kMeshScene + Object(1, "c/cube.obj")),
            here + ":19: 'object[0].model' names " + at("c/cube.obj") + ", which does not exist");
  fs::create_directories(folder_ / "d.ply");
  EXPECT_EQ(
      fault(kMeshScene + Object(1, "d.ply")),
      here + ":19: 'object[0].model' names " + at("d.ply") + ", which is a folder, not a file");
  EXPECT_EQ(fault(kMeshScene + Object(1, "a/cube.obj", "picture = \"no.png\"\n")),
            here + ":23: 'object[0].picture' names " + at("no.png") + ", which does not exist");
  fs::remove_all(folder_ / "paths");
  EXPECT_EQ(fault(kMeshScene), here + ":12: 'camera.file' names " + at("paths/cube.obj.txt") +
                                   ", which does not exist");
}

}  // namespace
}  // namespace tsdfpp
