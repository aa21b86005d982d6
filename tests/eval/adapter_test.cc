// Other people's programs in a comparison: limits, failures that stop nobody else, what they are
// given, and the adapters that come with the project.
#include "eval/adapters/adapter.h"

#include <gtest/gtest.h>

#include <fstream>
#include <set>

#include "core/files.h"
#include "core/ply.h"
#include "eval/compare/compare.h"
#include "eval/compare/compare_report.h"
#include "eval/compare/compare_tables.h"
#include "eval/score/surface_file.h"
#include "tests/cli/run_command.h"
#include "tests/core/temp_folder.h"
#include "tests/needs.h"
#include "tests/sequence/box_source.h"

namespace tsdfpp {
namespace {

using test::BoxSource;
using test::TempFolder;
namespace fs = std::filesystem;

std::string Toml(const std::string& name, const std::string& command,
                 const std::string& more = "") {
  return fmt::format("name = \"{}\"\ncommand = {}\n{}", name, command, more);
}

AdapterConfig Read(const TempFolder& folder, const std::string& text) {
  EXPECT_TRUE(WriteFile(folder / "a.toml", text).has_value());
  auto config = ReadAdapter(folder / "a.toml");
  if (!config) {
    ADD_FAILURE() << config.error().message;
    return {};
  }
  return *config;
}

TEST(Adapter, IsReadStrictlyAndWrittenBack) {
  const TempFolder folder;
  const AdapterConfig config = Read(
      folder,
      Toml("mine",
           R"(["run", "{sequence}", "--out={out}", "{frames}", "{truncation},{truncation_back}"])",
           "layout = \"tum\"\ntime_limit_s = 5\nmemory_limit_mb = 100.0\nscale = "
           "0.001\nmatch = \"overlap\"\n"));
  EXPECT_EQ(config.layout, DatasetFormat::kTum);
  EXPECT_EQ(config.match, MatchMode::kOverlap);
  const AdapterTask task{"/s", 1, 9, {3, 9}, {1, 2}, 0.01, 0.1, 0.03};
  const auto command = CommandOf(config, task, "/o");
  ASSERT_TRUE(command.has_value());
  EXPECT_EQ(*command, (std::vector<std::string>{"run", "/s", "--out=/o", "3,9", "0.1,0.03"}));
  EXPECT_EQ(Read(folder, config.ToToml()).ToToml(), config.ToToml());

  const std::vector<std::pair<std::string, std::string>> wrong{
      {"name = \"x\"\n", "command"},
      {Toml("a b", "[\"x\"]"), "name is 'a b'"},
      {Toml("a\\u0001b", "[\"x\"]"), "holds a control character"},
      {Toml(std::string(101, 'n'), "[\"x\"]"), "is longer than 100 bytes"},
      {Toml("-rf", "[\"x\"]"), "begins with a dot or a dash"},
      {Toml("nul", "[\"x\"]"), "is the name of a device"},
      {Toml("record", "[\"x\"]"), "of its own"},
      {Toml("Summary.json", "[\"x\"]"), "of its own"},
      {Toml("figure-close-gt.png", "[\"x\"]"), "of its own"},
      {Toml("tsdf++-literal_paper_icp", "[\"x\"]"), "of its own"},
      {Toml("x", "[]"), "command is empty"},
      {Toml("x", "[\"x\"]", "colour = 1\n"), "colour"},
      {Toml("x", "[\"x\"]", "layout = \"bop\"\n"), "layout is bop"},
      {Toml("x", "[\"x\"]", "layout = \"disc\"\n"), "disc"},
      {Toml("x", "[\"x\"]", "time_limit_s = 0\n"), "time_limit_s is 0"},
      {Toml("x", "[\"x\"]", "memory_limit_mb = -1\n"), "memory_limit_mb is -1"},
      {Toml("x", "[\"x\"]", "process_limit = 0\n"), "process_limit is 0, expected 1 to 30000"},
      {Toml("x", "[\"x\"]", "log_limit_mb = 0\n"), "log_limit_mb is 0"},
      {Toml("x", "[\"x\"]", "log_limit_mb = 1e9\n"), "log_limit_mb is 1000000000"},
      {Toml("x", "[\"x\"]", "disk_limit_mb = -2\n"), "disk_limit_mb is -2"},
      {Toml("x", "[\"x\"]", "memory_limit_mb = 1e200\n"), "expected above 0 and at most"},
      {Toml("x", "[\"x\"]", "scale = 0\n"), "scale is 0"},
      {Toml("x", "[\"x\"]", "match = \"luck\"\n"), "match is 'luck'"},
  };
  for (const auto& [text, words] : wrong) {
    ASSERT_TRUE(WriteFile(folder / "b.toml", text).has_value());
    const auto result = ReadAdapter(folder / "b.toml");
    ASSERT_FALSE(result.has_value()) << text;
    EXPECT_EQ(result.error().kind, ErrorKind::kUsage);
    EXPECT_NE(result.error().message.find("b.toml"), std::string::npos) << result.error().message;
    EXPECT_NE(result.error().message.find(words), std::string::npos) << result.error().message;
  }
  AdapterConfig odd = config;
  odd.command = {"run", "{sequenz}"};
  const auto unknown = CommandOf(odd, task, "/o");
  ASSERT_FALSE(unknown.has_value());
  EXPECT_NE(unknown.error().message.find("unknown word '{sequenz'"), std::string::npos)
      << unknown.error().message;
}

// An adapter must not write over what compare itself leaves.
TEST(Adapter, HasANameOfItsOwn) {
  const TempFolder folder;
  for (const char* name :
       {"summary.json", "Summary.JSON", "frames.csv", "table.txt", "report.html", "report.mp4",
        "run.json", "record", "frames", "gates.json", "figure-close-gt.png", "table-icp.png",
        "tsdf_close_gt", "tsdf++-anchored_paper_icp", "not-yet-known_close_icp"}) {
    ASSERT_TRUE(WriteFile(folder / "a.toml", Toml(name, "[\"x\"]")).has_value());
    const auto result = ReadAdapter(folder / "a.toml");
    ASSERT_FALSE(result.has_value()) << name;
    EXPECT_NE(result.error().message.find("of its own"), std::string::npos)
        << result.error().message;
  }
  for (const char* name :
       {"mine", "tsdf", "open3d-scalable", "records", "close_gt", "my_close_gt2"}) {
    EXPECT_EQ(Read(folder, Toml(name, "[\"x\"]")).name, name);
  }
}

// A comparison of shell scripts that copy prepared meshes.
class AdapterCompare : public testing::Test {
 protected:
  void SetUp() override {
    BoxSource source;
    const auto models = source.Truth();
    for (const int index : {3, 6}) {
      const auto frame = source.Read(index);
      TriangleMesh scene;
      for (const TrueModel& model : *models) {
        TriangleMesh mesh = model.mesh_O;
        const auto pose = frame->T_WO.find(model.info.id);
        for (Eigen::Vector3f& vertex : mesh.vertices) {
          if (pose != frame->T_WO.end()) {
            vertex = (pose->second * vertex.cast<double>()).cast<float>();
          }
        }
        mesh.face_ids.assign(mesh.triangles.size(), model.info.id);
        AppendMesh(mesh, scene);
      }
      ASSERT_TRUE(
          WritePly(folder_ / fmt::format("meshes/{:06d}/scene.ply", index), scene).has_value());
    }
  }

  AdapterConfig Script(const std::string& name, const std::string& script, double time_s = 60,
                       double memory_mb = 2000) {
    AdapterConfig config;
    config.name = name;
    config.command = {"sh", "-c", script, "sh", "{sequence}", folder_ / "meshes"};
    config.time_limit_s = time_s;
    config.memory_limit_mb = memory_mb;
    config.folder = folder_.path();
    return config;
  }

  // A comparison of this adapter alone, at frames 0 to 3.
  static CompareConfig Alone(AdapterConfig adapter) {
    CompareConfig config;
    config.methods = {};
    config.every = 4;
    config.until = "3";
    config.adapters = {std::move(adapter)};
    return config;
  }

  TempFolder folder_;
};

constexpr const char* kCopy = "cp -r $2 .";

TEST_F(AdapterCompare, AFailureIsReportedAndTheOthersGoOn) {
  BoxSource source(7);
  CompareConfig config;
  config.methods = {Method::kTsdf};
  config.profiles = {"close"};
  config.map.voxel_m = 0.03;
  config.every = 4;  // frames 3 and 6
  config.adapters = {
      Script("good", std::string(kCopy) + "; ls -R $1 > seen.txt"),
      Script("hangs", "sleep 600", 0.3),
      Script("crashes", "echo out of luck; kill -ABRT $$"),
      Script("eats",
             "exec /usr/bin/python3 -c 'import time\nx = bytearray(b\"x\") * 300000000\n"
             "time.sleep(60)'",
             60, 100),
      Script("half", std::string(kCopy) + "; head -c 300 $2/000006/scene.ply > "
                                          "meshes/000006/scene.ply"),
      Script("silent", "true"),
      Script("late", std::string(kCopy) + "; rm -r meshes/000003"),
      Script("talks", std::string(kCopy) + "; echo half > timing.json"),
      Script("lost",
             std::string(kCopy) + "; mkdir trajectories; echo 1 2 > trajectories/left-3.txt"),
      Script("pipe", std::string(kCopy) + "; rm meshes/000003/scene.ply; "
                                          "mkfifo meshes/000003/scene.ply"),
      Script("link", std::string(kCopy) + "; rm meshes/000006/scene.ply; "
                                          "ln -s $2/000006/scene.ply meshes/000006/scene.ply"),
      Script("moves", "mv meshes away; rm -rf meshes; ln -s $2 meshes"),
      Script("times", std::string(kCopy) + "; ln -s /dev/zero timing.json"),
      Script("leaves", std::string(kCopy) + "; mkfifo queue; ln -s /dev/zero endless; "
                                            "touch \"$(printf 'a\\377b')\""),
      Script("cut", "printf '\\342\\202\\254%.0s' $(seq 100); printf '\\342\\202'; exit 3"),
      Script("log", std::string(kCopy) + "; rm log.txt; mkfifo log.txt"),
      Script("last", kCopy),
  };
  const auto result = RunCompare(source, config, folder_ / "out", "the command", {});
  ASSERT_TRUE(result.has_value()) << result.error().message;
  ASSERT_EQ(result->runs.size(), 1U);
  EXPECT_EQ(result->runs[0]->evaluations.size(), 2U);
  const std::map<std::string, std::string> sentences{
      {"hangs", "hangs: ran longer than its limit of 0.3 s"},
      {"crashes", "ends with: out of luck"},
      {"eats", "more than its limit of 100 MB"},
      {"half", "scene.ply"},
      {"silent", "meshes: no such folder"},
      {"late", "holds nothing for frame 3"},
      {"talks", "talks/timing.json: not JSON"},
      {"lost", "left-3.txt"},
      {"pipe", "pipe/meshes/000003/scene.ply is a pipe, expected a file"},
      {"link", "link/meshes/000006/scene.ply is a link, expected a file"},
      {"moves", "moves/meshes is a link, expected a file"},
      {"times", "times/timing.json is a link, expected a file"},
      {"cut", "ended with exit code 3"}};
  const std::string table = SummaryTable(*result);
  const nlohmann::json summary = SummaryJson(*result, "the command");
  ASSERT_EQ(summary.at("adapters").size(), config.adapters.size());
  for (std::size_t i = 0; i < config.adapters.size(); ++i) {
    const AdapterRun& run = *result->adapters[i];
    const nlohmann::json& json = summary.at("adapters")[i];
    const auto sentence = sentences.find(run.config.name);
    if (sentence == sentences.end()) {
      EXPECT_FALSE(run.failure.has_value()) << run.failure->message;
      ASSERT_EQ(run.evaluations.size(), 2U);
      EXPECT_EQ(run.evaluations[1].visible_completion.value, 1.0);
      EXPECT_TRUE(json.at("failure").is_null());
      EXPECT_EQ(json.at("evaluations").size(), 2U);
      continue;
    }
    ASSERT_TRUE(run.failure.has_value()) << run.config.name;
    EXPECT_NE(run.failure->message.find(sentence->second), std::string::npos)
        << run.failure->message;
    EXPECT_TRUE(run.failure->message.starts_with(run.config.name)) << run.failure->message;
    EXPECT_NE(table.find("failed: " + run.failure->message), std::string::npos) << table;
    EXPECT_EQ(json.at("failure"), run.failure->message);
    EXPECT_TRUE(json.at("evaluations").empty()) << "of the frames before";
  }
  // All of it can be written down, also half a character.
  EXPECT_NO_THROW((void)summary.dump());
  EXPECT_EQ(ReadFile(folder_ / "out/summary.json").value_or("").find(".tsdfpp-run"),
            std::string::npos);
  for (const char* gone :
       {"leaves/queue", "leaves/endless", "log/log.txt", "pipe/meshes/000003/scene.ply"}) {
    EXPECT_FALSE(fs::exists(fs::symlink_status(folder_ / "out" / gone))) << gone;
  }
  const auto& leaves = *std::find_if(result->adapters.begin(), result->adapters.end(),
                                     [](const auto& run) { return run->config.name == "leaves"; });
  EXPECT_EQ(leaves->remarks,
            std::vector<std::string>{"3 links, pipes, devices or files with odd names are removed "
                                     "from " +
                                     (folder_ / "out/leaves").string()});
  // What an adapter is given: the frames, and nothing of the truth.
  const std::string seen = ReadFile(folder_ / "out/good/seen.txt").value_or("");
  EXPECT_NE(seen.find("Color0006.png"), std::string::npos) << seen;
  EXPECT_NE(seen.find("gt-cam-0.txt"), std::string::npos);
  EXPECT_EQ(seen.find(".ply"), std::string::npos);
  EXPECT_EQ(seen.find("truth"), std::string::npos);
  EXPECT_FALSE(fs::exists(folder_ / "out/.sequence-cofusion"));
  const std::string csv = ReadFile(folder_ / "out/frames.csv").value_or("");
  EXPECT_NE(csv.find("\n3,good,,,"), std::string::npos) << csv;
  EXPECT_TRUE(fs::exists(folder_ / "out/report.html"));
}

TEST_F(AdapterCompare, ALayoutMayBeChosenAndOldFilesDoNotCount) {
  BoxSource source(7);
  AdapterConfig adapter = Script("tum", std::string(kCopy) + "; cp $1/associations.txt .");
  adapter.layout = DatasetFormat::kTum;
  CompareConfig config = Alone(adapter);
  auto result = RunCompare(source, config, folder_ / "out", "the command", {});
  ASSERT_TRUE(result.has_value()) << result.error().message;
  EXPECT_FALSE(result->adapters[0]->failure.has_value()) << result->adapters[0]->failure->message;
  // Frames 0 to 3, no later ones.
  const std::string pairs = ReadFile(folder_ / "out/tum/associations.txt").value_or("");
  EXPECT_EQ(std::count(pairs.begin(), pairs.end(), '\n'), 4) << pairs;
  // The next run writes nothing: the first one's meshes must not stand in.
  config.adapters[0].command = {"true"};
  result = RunCompare(source, config, folder_ / "out", "the command", {});
  ASSERT_TRUE(result.has_value()) << result.error().message;
  EXPECT_TRUE(result->adapters[0]->failure.has_value());
}

// So deep that the whole path is longer than the system takes: no path leads to the innermost.
TEST_F(AdapterCompare, FoldersNestedTooDeepAreItsFailure) {
  BoxSource source(7);
  const CompareConfig config = Alone(Script(
      "deep", std::string(kCopy) + "; exec /usr/bin/python3 -c 'import os\nfor i in range(300):\n"
                                   " os.mkdir(\"a\" * 25)\n os.chdir(\"a\" * 25)'"));
  const auto result = RunCompare(source, config, folder_ / "out", "the command", {});
  ASSERT_TRUE(result.has_value()) << result.error().message;
  const auto& failure = result->adapters[0]->failure;
  ASSERT_TRUE(failure.has_value());
  EXPECT_TRUE(failure->message.starts_with("deep: what it left is removed: ")) << failure->message;
}

// They would stand in the way of the run's own files, or pass for some.
TEST_F(AdapterCompare, WhatIsLeftBesideItsFolderIsRemovedAndSaid) {
  BoxSource source(7);
  const CompareConfig config = Alone(Script(
      "stray", std::string(kCopy) + "; mkdir ../summary.json; touch ../summary.json/x ../mine"));
  const auto result = RunCompare(source, config, folder_ / "out", "the command", {});
  ASSERT_TRUE(result.has_value()) << result.error().message;
  EXPECT_TRUE(fs::is_regular_file(folder_ / "out/summary.json"));
  EXPECT_FALSE(fs::exists(folder_ / "out/mine"));
  const auto& remarks = result->adapters[0]->remarks;
  for (const char* name : {"'summary.json'", "'mine'"}) {
    EXPECT_TRUE(std::any_of(remarks.begin(), remarks.end(), [&](const std::string& remark) {
      return remark.find(name) != std::string::npos;
    })) << name;
  }
}

nlohmann::json CompareMini(const TempFolder& folder, const std::string& methods) {
  const std::string scene = TSDFPP_SOURCE_DIR "/scenes/mini.toml";
  const auto command =
      test::RunTsdfpp({"compare", scene, "--out", folder / "out", "--methods", methods,
                       "--profiles", "close", "--until", "6", "--every", "6", "--json"},
                      folder.path());
  EXPECT_EQ(command.exit_code, 0) << command.err;
  return nlohmann::json::parse(command.out, nullptr, false);
}

// The same volume, once from depth rounded to 0.1 mm: a hundredth of a voxel.
constexpr double kSameCompletion = 0.01;
// On average no farther from the truth than the largest threshold that scores ask for, two voxels.
constexpr double kAccuracy_m = 0.02;

TEST(BundledAdapters, MapTheStaticWorld) {
  const TempFolder folder;
  const bool python = RunChildProcess("python", {"/usr/bin/python3", "-c", "import open3d"},
                                      folder.path(), folder / "log", {})
                          .failure == std::nullopt;
  const std::string methods = "open3d-scalable,open3d-scalable-back,open3d-voxelblockgrid";
  const nlohmann::json summary = CompareMini(folder, python ? methods + ",open3d-python" : methods);
  ASSERT_FALSE(summary.is_discarded());
  ASSERT_EQ(summary.at("adapters").size(), python ? 4U : 3U);
  // Without maps of ours the noted command has no option of theirs: it can be run again.
  EXPECT_EQ(summary.at("command").get<std::string>().find("--poses"), std::string::npos);
  std::map<std::string, double> completion;
  for (const nlohmann::json& adapter : summary.at("adapters")) {
    ASSERT_TRUE(adapter.at("failure").is_null()) << adapter.at("failure");
    const nlohmann::json& examined = adapter.at("examined");
    EXPECT_EQ(examined.at("labelled"), false);
    EXPECT_EQ(adapter.at("timing").at("frame_ms").size(), 6U);
    const std::string name = adapter.at("name");
    completion[name] = examined.at("visible_completion");
    // All that is seen is mapped but for edges.
    EXPECT_GT(completion[name], 0.9) << name;
    EXPECT_LT(examined.at("objects")[0].at("accuracy").at("mean_m").get<double>(), kAccuracy_m)
        << name;
  }
  // Its band is thinner.
  EXPECT_NE(completion["open3d-scalable-back"], completion["open3d-scalable"]);
  TSDFPP_NEEDS(python, "python3-open3d");
  EXPECT_NEAR(completion["open3d-python"], completion["open3d-scalable"], kSameCompletion);
}

}  // namespace
}  // namespace tsdfpp
