// A sequence can be rendered again from itself, without the files that its scene was made of.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "core/files.h"
#include "sequence/sequence_json.h"
#include "tests/core/temp_folder.h"
#include "tests/eval/tiny_scene.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;
using test::RunTsdfpp;

// A pyramid, its apex at `height`.
std::string Pyramid(double height) {
  return fmt::format(
      "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nv 0 0 {}\nf 4 3 2 1\nf 1 2 5\nf 2 3 5\nf 3 4 5\n"
      "f 4 1 5\n",
      height);
}

std::string Object(const std::string& name, int id, const std::string& file, double x) {
  return fmt::format(
      "[[object]]\nname = \"{0}\"\nid = {1}\nclass = \"tent\"\nmodel = \"{2}\"\nscale = 0.05\n"
      "x = {3}\ny = -0.25\n",
      name, id, file, x);
}

class Inputs : public testing::Test {
 protected:
  void SetUp() override {
    Write("user/one/tent.obj", "mtllib tent.mtl\nusemtl red\n" + Pyramid(1));
    Write("user/one/tent.mtl", "newmtl red\nKd 0.9 0.1 0.1\n");
    Write("user/two/tent.obj", Pyramid(2));
    Write("user/scenes/tents.toml", test::TinyScene(3) + Object("low", 3, "../one/tent.obj", -0.3) +
                                        Object("high", 4, "../two/tent.obj", 0.3));
  }
  void Write(const std::string& file, const std::string& bytes) {
    ASSERT_TRUE(WriteFile(folder_ / file, bytes).has_value());
  }
  test::CommandOutput Generate(const fs::path& scene, const fs::path& out) {
    return RunTsdfpp({"generate", scene, "--out", out, "--jobs", "1"}, folder_.path());
  }
  test::TempFolder folder_;
};

TEST_F(Inputs, ASequenceIsMadeAgainFromItself) {
  const auto made = Generate(folder_ / "user/scenes/tents.toml", folder_ / "made");
  ASSERT_EQ(made.exit_code, 0) << made.err;
  // As if it were copied to another machine.
  fs::rename(folder_ / "made", folder_ / "copied");
  fs::remove_all(folder_ / "user");
  const auto record = ReadSequenceJson(folder_ / "copied/sequence.json");
  ASSERT_TRUE(record.has_value());
  for (const char* file : {"inputs/1/tent.obj", "inputs/1/tent.mtl", "inputs/2/tent.obj"}) {
    EXPECT_TRUE(record->hashes.contains(file)) << file;
  }
  const auto verified = RunTsdfpp({"verify", folder_ / "copied", "--json"}, folder_.path());
  EXPECT_EQ(verified.exit_code, 0) << verified.err;
  EXPECT_EQ(nlohmann::json::parse(verified.out)["notes"], nlohmann::json::array());
  const auto again = Generate(folder_ / "copied/scene.toml", folder_ / "again");
  ASSERT_EQ(again.exit_code, 0) << again.err;
  EXPECT_EQ(ReadFile(folder_ / "again/sequence.json").value(),
            ReadFile(folder_ / "copied/sequence.json").value());
  // A mesh that is not the one that was rendered is found.
  Write("copied/inputs/2/tent.obj", Pyramid(3));
  const auto changed = RunTsdfpp({"verify", folder_ / "copied"}, folder_.path());
  EXPECT_EQ(changed.exit_code, 4);
  for (const char* words : {"files: inputs/2/tent.obj", "scene: models/high-4.ply"}) {
    EXPECT_NE(changed.out.find(words), std::string::npos) << words << " is not in " << changed.out;
  }
}

}  // namespace
}  // namespace tsdfpp
