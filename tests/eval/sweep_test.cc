// Experiments run by the command: what they say is what a comparison says, nothing runs twice, a
// killed run goes on, and any frame can be made again. Longer than most files: a sweep is started,
// killed, edited and replayed in one folder.
#include <fcntl.h>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <set>
#include <thread>

#include "core/files.h"
#include "eval/run/folder_lock.h"
#include "eval/sweep/sequence_variant.h"
#include "tests/cli/run_command.h"
#include "tests/core/temp_folder.h"
#include "tests/eval/tiny_scene.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using test::RunTsdfpp;

constexpr int kFrames = 8;

class Sweep : public testing::Test {
 protected:
  void SetUp() override {
    ASSERT_TRUE(WriteFile(folder_ / "tiny.toml", test::TinyScene(kFrames) + R"(
[experiment]
reveal_frame = 7
removed = ["car"]
)")
                    .has_value());
  }
  fs::path Experiment(const std::string& grid, const std::string& frames = "every = 2") {
    fs::path file = folder_ / "e.toml";
    EXPECT_TRUE(WriteFile(file, fmt::format(R"(name = "e"
question = "Does it run?"
metrics = ["table_preservation_behind_other", "movers_completion"]
[frames]
{}
[[grid]]
scene = "tiny.toml"
{}
)",
                                            frames, grid))
                    .has_value());
    return file;
  }
  json RunSweep(const fs::path& file, const std::string& out,
                const std::vector<std::string>& more = {}) {
    std::vector<std::string> arguments{"sweep", file.string(), "--json", "--out", folder_ / out};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const auto ran = RunTsdfpp(arguments, folder_.path());
    EXPECT_EQ(ran.exit_code, 0) << ran.err;
    return json::parse(ran.out, nullptr, false);
  }
  std::string Bytes(const fs::path& file) {
    const auto bytes = ReadFile(folder_ / file.string());
    EXPECT_TRUE(bytes.has_value()) << file;
    return bytes.value_or("");
  }
  // What a cell says but for times.
  json Timeless(const fs::path& cell) {
    json read = json::parse(Bytes(cell), nullptr, false);
    read.erase("times");
    for (const char* timed : {"frame_ms", "move_ms", "fuse_ms", "mesh_ms"})
      read["examined"].erase(timed);
    for (const char* timed : {"mesh_s", "evaluate_s"}) read["evaluation"].erase(timed);
    return read;
  }
  std::set<std::string> CellFiles(const std::string& out) {
    std::set<std::string> files;
    std::error_code none;
    for (const auto& entry : fs::directory_iterator(folder_ / out / "cells", none)) {
      files.insert(entry.path().filename().string());
    }
    return files;
  }
  test::TempFolder folder_;
};

TEST_F(Sweep, SaysWhatACompareSays) {
  const json swept = RunSweep(
      Experiment("method = [\"tsdf\", \"tsdf++\", \"tsdf++/anchored\"]\nvoxel_m = 0.02"), "out");
  const auto compared =
      RunTsdfpp({"compare", folder_ / "tiny.toml", "--out", folder_ / "compared", "--profiles",
                 "close", "--voxel", "0.02", "--every", "1000", "--json"},
                folder_.path());
  ASSERT_EQ(compared.exit_code, 0) << compared.err;
  const json summary = json::parse(compared.out);
  ASSERT_EQ(swept.at("cells").size(), 3U);
  int met = 0;
  for (const auto& [id, cell] : swept.at("cells").items()) {
    for (const json& run : summary.at("runs")) {
      if (run.at("method") != cell.at("settings").at("method")) continue;
      ++met;
      const json& table = run.at("examined").at("objects").at(0);
      EXPECT_EQ(cell.at("examined").at("table_preservation_behind_other"),
                table.at("preservation_behind_other"));
      EXPECT_EQ(cell.at("examined").at("visible_completion"),
                run.at("examined").at("visible_completion"));
      EXPECT_EQ(cell.at("examined").at("ghost_area_cm2").get<double>(),
                1e4 * run.at("examined").at("ghost_area_m2").get<double>());
      EXPECT_EQ(cell.at("examined").at("revealed_unseen_area_cm2").get<double>(),
                1e4 * run.at("examined").at("revealed_unseen_area_m2").get<double>());
    }
    EXPECT_TRUE(cell.at("examined").at("table_preservation_behind_other").is_number());
  }
  EXPECT_EQ(met, 3);
}

// Objects that the pipeline finds itself have ids of their own, and count as the same true ones.
TEST_F(Sweep, FindsObjectsAsACompareDoes) {
  for (const std::string segmentation : {"depth", "full"}) {
    const json swept = RunSweep(Experiment(fmt::format("method = \"tsdf++/anchored\"\n"
                                                       "voxel_m = 0.02\nposes = \"track\"\n"
                                                       "segmentation = \"{}\"",
                                                       segmentation),
                                           "every = 3"),
                                "out-" + segmentation);
    const auto compared = RunTsdfpp(
        {"compare", folder_ / "tiny.toml", "--out", folder_ / ("compared-" + segmentation),
         "--methods", "tsdf++/anchored", "--profiles", "close", "--voxel", "0.02", "--every", "3",
         "--poses", "track", "--segmentation", segmentation, "--json"},
        folder_.path());
    ASSERT_EQ(compared.exit_code, 0) << compared.err;
    const json examined = json::parse(compared.out).at("runs").at(0).at("examined");
    const std::string id = swept.at("cells").begin().key();
    const json& cell = swept.at("cells").at(id);
    EXPECT_EQ(cell.at("examined").at("table_preservation_behind_other"),
              examined.at("objects").at(0).at("preservation_behind_other"));
    EXPECT_EQ(cell.at("examined").at("visible_completion"), examined.at("visible_completion"));
    EXPECT_GT(cell.at("examined").at("visible_completion"), 0.5);
    const auto replayed =
        RunTsdfpp({"replay", folder_ / ("out-" + segmentation), "--cell", id, "--frame", "6",
                   "--out", folder_ / ("replayed-" + segmentation), "--json"},
                  folder_.path());
    EXPECT_EQ(replayed.exit_code, 0) << replayed.err;
  }
}

TEST_F(Sweep, NothingRunsTwiceAndJobsChangeNothing) {
  const fs::path file =
      Experiment("method = [\"tsdf\", \"open3d/3\"]\nseed = [1, 2]\nvoxel_m = 0.02", "");
  EXPECT_EQ(RunSweep(file, "one", {"--jobs", "1"}).at("run_now"), 4);
  EXPECT_EQ(RunSweep(file, "two", {"--jobs", "2"}).at("run_now"), 4);
  ASSERT_EQ(CellFiles("one").size(), 4U);
  ASSERT_EQ(CellFiles("one"), CellFiles("two"));
  for (const std::string& cell : CellFiles("one")) {
    EXPECT_EQ(Timeless(fs::path("one/cells") / cell), Timeless(fs::path("two/cells") / cell));
  }
  // Nothing, then what is missing or damaged alone; the others' files stay as they are, times too.
  const std::string csv = Bytes("one/results.csv");
  EXPECT_EQ(RunSweep(file, "one").at("run_now"), 0);
  EXPECT_EQ(Bytes("one/results.csv"), csv);
  const std::string first = *CellFiles("one").begin();
  const std::string last = *CellFiles("one").rbegin();
  const std::string kept = Bytes(fs::path("one/cells") / last);
  const json before = Timeless(fs::path("one/cells") / first);
  ASSERT_TRUE(WriteFile(folder_ / "one" / "cells" / first, kept.substr(0, 40)).has_value());
  EXPECT_EQ(RunSweep(file, "one").at("run_now"), 1);
  EXPECT_EQ(Timeless(fs::path("one/cells") / first), before);
  EXPECT_EQ(Bytes(fs::path("one/cells") / last), kept);
  // An edited one is made again as well.
  json edited = json::parse(Bytes(fs::path("one/cells") / first));
  edited["examined"]["visible_completion"] = 0.123;
  ASSERT_TRUE(WriteFile(folder_ / "one" / "cells" / first, edited.dump()).has_value());
  EXPECT_EQ(RunSweep(file, "one").at("run_now"), 1);
  EXPECT_EQ(Timeless(fs::path("one/cells") / first), before);
  // A larger experiment adds what is new.
  EXPECT_EQ(RunSweep(Experiment("method = [\"tsdf\", \"open3d/3\"]\nseed = [1, 2]\n"
                                "voxel_m = [0.02, 0.03]",
                                ""),
                     "one")
                .at("run_now"),
            4);
}

// What no experiment left is not replaced, and nothing is written behind a link.
TEST_F(Sweep, FilesOfOthersStay) {
  const fs::path file = Experiment("method = \"tsdf\"\nvoxel_m = 0.03", "");
  const fs::path out = folder_ / "out";
  const auto refused = [&](const std::string& words) {
    const auto run = RunTsdfpp({"sweep", file, "--out", out}, folder_.path());
    EXPECT_EQ(run.exit_code, test::kUsage) << words << run.err;
    EXPECT_NE(run.err.find(words), std::string::npos) << run.err;
  };
  // Folders of these names may be anybody's.
  ASSERT_TRUE(WriteFile(out / "cells/blood.json", "{}").has_value());
  ASSERT_TRUE(WriteFile(out / "sequences/mini/scene.toml", "").has_value());
  for (const char* name : {"results.json", "results.csv", "summary.txt"}) {
    ASSERT_TRUE(WriteFile(out / name, "theirs").has_value());
    refused(std::string(name) + ": is of no earlier run and would be replaced");
    EXPECT_EQ(ReadFile(out / name), "theirs");
    fs::remove(out / name);
  }
  const fs::path elsewhere = folder_ / "elsewhere";
  fs::create_directories(elsewhere);
  for (const char* name : {"cells", "sequences"}) {
    fs::rename(out / name, out / "aside");
    fs::create_directory_symlink(elsewhere, out / name);
    refused(std::string(name) + ": is a link, expected a folder or nothing");
    fs::remove(out / name);
    fs::rename(out / "aside", out / name);
  }
  EXPECT_TRUE(fs::is_empty(elsewhere));
  // A download, say.
  ASSERT_TRUE(WriteFile(out / ".film.mp4.part", "half").has_value());
  EXPECT_EQ(RunSweep(file, "out").at("run_now"), 1);
  EXPECT_EQ(ReadFile(out / ".film.mp4.part"), "half");
  EXPECT_EQ(RunSweep(file, "out").at("run_now"), 0);
  fs::remove(out / "summary.txt");
  fs::create_directory(out / "summary.txt");
  refused("summary.txt: is of no earlier run");
}

// Cells that differ in what is scored alone are mapped once, and say what each says by itself.
TEST_F(Sweep, OneMapIsLookedAtInManyWays) {
  const auto grid = [](const std::string& sabotage) {
    return "method = \"tsdf++/anchored\"\nvoxel_m = 0.02\nsabotage = " + sabotage;
  };
  const std::vector<std::string> ways{"'none'", "'inactive-dropped'", "'labels-permuted'",
                                      "'visible-only'"};
  RunSweep(Experiment(grid(fmt::format("[{}]", fmt::join(ways, ", ")))), "together");
  ASSERT_EQ(CellFiles("together").size(), ways.size());
  for (const std::string& way : ways) RunSweep(Experiment(grid(way)), "apart");
  ASSERT_EQ(CellFiles("apart"), CellFiles("together"));
  std::set<json> times;
  std::set<json> examined;
  for (const std::string& cell : CellFiles("together")) {
    const json timeless = Timeless(fs::path("together/cells") / cell);
    EXPECT_EQ(timeless, Timeless(fs::path("apart/cells") / cell));
    times.insert(json::parse(Bytes(fs::path("together/cells") / cell)).at("times"));
    examined.insert(timeless.at("examined"));
  }
  EXPECT_EQ(times.size(), 1U);
  EXPECT_EQ(examined.size(), ways.size());
}

TEST_F(Sweep, AKilledRunLeavesNoHalfCellAndGoesOn) {
  const fs::path file =
      Experiment("method = [\"tsdf\", \"tsdf++\"]\nseed = [1, 2, 3]\nvoxel_m = 0.02", "");
  for (const int signal : {SIGINT, SIGTERM, SIGKILL}) {
    const std::string out = fmt::format("out{}", signal);
    const std::string words = folder_ / (out + ".err");
    const pid_t process = fork();
    if (process == 0) {
      setpgid(0, 0);
      dup2(open(words.c_str(), O_WRONLY | O_CREAT, 0600), STDERR_FILENO);
      dup2(open("/dev/null", O_WRONLY), STDOUT_FILENO);
      execl(TSDFPP_COMMAND, TSDFPP_COMMAND, "sweep", file.c_str(), "--jobs", "1", "--out",
            (folder_ / out).c_str(), nullptr);
      _exit(127);
    }
    // Until the first sequence's cells are there and the others are not.
    while (CellFiles(out).size() < 2 && waitpid(process, nullptr, WNOHANG) == 0) {
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
    // As terminals, timeout and systemd do: to its workers, too.
    kill(-process, signal);
    int status = 0;
    waitpid(process, &status, 0);
    EXPECT_TRUE(WIFSIGNALED(status));
    EXPECT_EQ(WTERMSIG(status), signal);
    if (signal != SIGKILL) {
      EXPECT_NE(Bytes(out + ".err").find("stopped; the same command goes on from there"),
                std::string::npos)
          << Bytes(out + ".err");
    }
    // Its workers end a moment later, and hold the folder until then.
    for (int i = 0; i < 1000 && !FolderLock::Take(folder_ / out); ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    int whole = 0;
    for (const std::string& cell : CellFiles(out)) {
      if (!cell.ends_with(".json")) continue;
      EXPECT_FALSE(
          json::parse(Bytes(fs::path(out) / "cells" / cell), nullptr, false).is_discarded());
      ++whole;
    }
    EXPECT_GE(whole, 1);
    EXPECT_FALSE(fs::exists(folder_ / out / "results.json"));
    EXPECT_EQ(RunSweep(file, out).at("run_now"), 6 - whole);
    EXPECT_EQ(CellFiles(out).size(), 6U);
    for (const std::string& cell : CellFiles(out)) EXPECT_TRUE(cell.ends_with(".json")) << cell;
  }
}

TEST_F(Sweep, WhatDoesNotFitASceneGetsASentence) {
  const std::vector<std::pair<std::string, std::string>> cases{
      {"noise = 2", "noise is 2, but sensor 'scene' has exact depth"},
      {"objects = 3", "objects is 3, but the scene has 2"},
      {"mask_faults = 5", "rate"},
      {"sensor = \"masks_mild\"\nmask_faults = 1", "has mask faults of its own"},
      {"poses = \"track\"\nsegmentation = \"depth\"\nmask_faults = 1",
       "reads no masks, expected 0"},
      {"poses = \"track\"\nsegmentation = \"depth\"\nsensor = \"masks_mild\"", "has mask faults"},
      {"sensor = \"pose_drift\"\ncamera_error = 1", "has pose errors of its own"},
      {"speed = 100", "expected 2 or more"},
      {"fuse_until = 8", "fuse_until is 8, but the last frame is 7"},
      {"method = \"surfels\"\nmask_repair = \"on\"", "which method 'surfels' has not"},
      {"method = \"open3d/8\"\nmask_repair = \"on\"", "'open3d/8' is given no masks"},
  };
  for (const auto& [setting, sentence] : cases) {
    const bool with_method = setting.starts_with("method");
    const std::string method = setting.starts_with("poses") ? "tsdf++/anchored" : "tsdf";
    const std::string grid =
        with_method ? setting : fmt::format("method = \"{}\"\n{}", method, setting);
    const auto ran =
        RunTsdfpp({"sweep", Experiment(grid).string(), "--out", folder_ / "out"}, folder_.path());
    EXPECT_EQ(ran.exit_code, 2) << grid;
    EXPECT_NE(ran.err.find(sentence), std::string::npos) << ran.err;
    EXPECT_NE(ran.err.find("grid '1'"), std::string::npos) << ran.err;
    EXPECT_FALSE(fs::exists(folder_ / "out"));
  }
}

TEST_F(Sweep, AnyFrameCanBeMadeAgain) {
  const json swept = RunSweep(
      Experiment("method = [\"tsdf\", \"tsdf++\"]\nvoxel_m = 0.02\nsensor = \"nguyen2012\"\n"
                 "object_error = 1"),
      "out");
  for (const auto& [id, cell] : swept.at("cells").items()) {
    for (const int frame : {3, 6}) {  // evaluated; not evaluated
      const auto replay = [&, id = id](const std::string& out) {
        const auto ran =
            RunTsdfpp({"replay", folder_ / "out", "--cell", id.substr(0, 12), "--frame",
                       std::to_string(frame), "--out", folder_ / out, "--json"},
                      folder_.path());
        EXPECT_EQ(ran.exit_code, 0) << ran.err;
        return json::parse(ran.out, nullptr, false);
      };
      const std::string name = fmt::format("{}-{}", id, frame);
      const json first = replay(name);
      const json again = replay(name + "-again");
      EXPECT_EQ(first.at("compared_map_frame"), frame == 3 ? 3 : 5);
      for (const json& file : first.at("files")) {
        const std::string path = file.get<std::string>();
        EXPECT_EQ(Bytes(fs::path(name) / path), Bytes(fs::path(name + "-again") / path)) << path;
      }
      const auto has = [&](const char* file) { return fs::exists(folder_ / name / file); };
      for (const char* file : {"camera/colour.png", "camera/depth.exr", "camera/mask.png",
                               "views/depth-1.exr", "slice.png", "scene.ply"}) {
        EXPECT_TRUE(has(file)) << file;
      }
      const json noted = json::parse(Bytes(fs::path("out/cells") / (id + ".json")));
      EXPECT_EQ(first.at("image_digest"), noted.at("images").at(std::to_string(frame)));
    }
  }
  // So can one of frames that were broken on purpose.
  const json sabotaged = RunSweep(
      Experiment("method = \"tsdf++\"\nvoxel_m = 0.02\nsabotage = \"depth-scale\""), "sabotaged");
  const auto replayed =
      RunTsdfpp({"replay", folder_ / "sabotaged", "--cell", sabotaged.at("cells").begin().key(),
                 "--frame", "3", "--out", folder_ / "sabotaged-3", "--json"},
                folder_.path());
  EXPECT_EQ(replayed.exit_code, 0) << replayed.err;
  const std::string id = swept.at("cells").begin().key();
  const auto wrong = [&](const std::string& cell, const char* frame) {
    const auto ran = RunTsdfpp(
        {"replay", folder_ / "out", "--cell", cell, "--frame", frame, "--out", folder_ / "none"},
        folder_.path());
    EXPECT_FALSE(fs::exists(folder_ / "none"));
    return fmt::format("{} {}", ran.exit_code, ran.err);
  };
  EXPECT_TRUE(wrong("nocell", "3").starts_with("2 ")) << wrong("nocell", "3");
  EXPECT_TRUE(wrong(id, "8").starts_with("2 ")) << wrong(id, "8");
  // What is not what it was is said, and not written.
  const fs::path file = folder_ / "out" / "cells" / (id + ".json");
  json noted = json::parse(Bytes(fs::path("out/cells") / (id + ".json")));
  noted["images"]["3"] = "0000000000000000";
  ASSERT_TRUE(WriteFile(file, noted.dump()).has_value());
  EXPECT_TRUE(wrong(id, "3").starts_with("4 ")) << wrong(id, "3");
  EXPECT_NE(wrong(id, "3").find("are not what they were"), std::string::npos);
}

// What is edited afterwards gets a sentence: the cell's file and the experiment's.
TEST_F(Sweep, AnEditedResultIsNotReplayed) {
  const json swept = RunSweep(Experiment("method = [\"tsdf\"]\nvoxel_m = 0.02"), "out");
  const std::string id = swept.at("cells").begin().key();
  const std::string of = swept.at("cells").at(id).at("sequence");
  const fs::path all = folder_ / "out/results.json";
  const fs::path one = folder_ / "out/cells" / (id + ".json");
  const auto said = [&](const fs::path& file, const std::function<void(json&)>& edit) {
    const std::string whole = ReadFile(file).value();
    json edited = json::parse(whole);
    edit(edited);
    EXPECT_TRUE(WriteFile(file, edited.dump()).has_value());
    const auto ran = RunTsdfpp(
        {"replay", folder_ / "out", "--cell", id, "--frame", "3", "--out", folder_ / "none"},
        folder_.path());
    EXPECT_FALSE(fs::exists(folder_ / "none"));
    EXPECT_TRUE(WriteFile(file, whole).has_value());
    return fmt::format("{} {}", ran.exit_code, ran.err);
  };
  const auto in_sequence = [&](const std::function<void(json&)>& edit) {
    return said(all, [&](json& value) { edit(value["sequences"][of]); });
  };
  const std::vector<std::string> sentences{
      in_sequence([](json& s) { s["frames"] = json::array(); }),
      in_sequence([](json& s) {
        s["frames"] = {1, 3, 2};
      }),
      in_sequence([](json& s) {
        s["frames"] = {1, 3, 4294967299};
      }),
      in_sequence([](json& s) {
        s["frames"] = {1, 3, 1000000};
      }),
      in_sequence([](json& s) { s["evaluated"] = json::array(); }),
      in_sequence([](json& s) {
        s["evaluated"] = {0, 7};
      }),
      in_sequence([](json& s) { s["examined"] = 8; }),
      in_sequence([](json& s) { s["object_error"] = 1e308; }),
      in_sequence([](json& s) { s["fuse_until"] = -1; }),
      said(all,
           [&](json& value) {
             value["cells"][id]["settings"]["method"] = "surfels";
             value["cells"][id]["settings"]["poses"] = "track";
           }),
      said(one, [](json& c) { c.erase("images"); }),
      said(one, [](json& c) { c["images"] = {1}; }),
      said(one, [](json& c) { c["images"]["3"] = 5; }),
      said(one, [](json& c) { c.erase("removed"); }),
      said(one, [](json& c) { c["removed"] = {"x"}; }),
      said(one, [](json& c) { c["removed"] = {70000}; }),
      said(one, [](json& c) { c.erase("frames"); })};
  for (const std::string& sentence : sentences) {
    EXPECT_TRUE(sentence.starts_with("4 tsdfpp: ")) << sentence;
    EXPECT_NE(sentence.find("a field is missing or wrong"), std::string::npos) << sentence;
  }
  // One frame has no step.
  const std::string single = in_sequence([](json& s) {
    s["frames"] = s["evaluated"] = {2};
    s["examined"] = 2;
  });
  EXPECT_TRUE(single.starts_with("2 tsdfpp: ")) << single;
  EXPECT_NE(single.find("is not among the 1 that it used, 2 to 2"), std::string::npos) << single;
}

// Draws of object poses: of the stated size, each frame alone, the truth untouched; and blind
// frames.
TEST_F(Sweep, GivenPosesAreOffAndLateFramesAreBlind) {
  CellSettings settings;
  settings.scene = "tiny.toml";
  settings.object_error = 2;
  settings.fuse_until = 5;
  VariantMaker maker(folder_.path(), FrameChoice{});
  auto variant = maker.Make(settings);
  ASSERT_TRUE(variant.has_value()) << variant.error().message;
  auto source = VariantSource::Open(*variant);
  ASSERT_TRUE(source.has_value()) << source.error().message;
  double squares = 0;
  int count = 0;
  for (int index = 1; index <= 7; ++index) {
    const auto both = source->Read(index);
    ASSERT_TRUE(both.has_value());
    for (const InstanceId id : {1, 2}) {
      const Pose off = both->truth.T_WO.at(id).inverse() * both->frame.T_WO.at(id);
      squares += off.translation().squaredNorm();
      ++count;
    }
    EXPECT_EQ(cv::countNonZero(both->frame.depth) == 0, index > 5) << index;
    EXPECT_EQ(cv::countNonZero(both->truth.depth) == 0, index > 5) << index;
  }
  // Fourteen draws of three axes of 2 mm: within a half of it.
  const double sigma_m = std::sqrt(squares / (3 * count));
  EXPECT_GT(sigma_m, 0.001);
  EXPECT_LT(sigma_m, 0.003);
}

TEST_F(Sweep, FramesAreCountedFromTheExaminedOne) {
  CellSettings settings;
  settings.scene = "tiny.toml";
  settings.speed = 2;
  FrameChoice choice;
  choice.every = 2;
  choice.until = "end";
  VariantMaker maker(folder_.path(), choice);
  const auto variant = maker.Make(settings);
  ASSERT_TRUE(variant.has_value()) << variant.error().message;
  EXPECT_EQ(variant->frames, (std::vector<int>{1, 3, 5, 7}));
  EXPECT_EQ(variant->evaluated, (std::vector<int>{3, 7}));
  EXPECT_EQ(variant->examined, 7);
}

}  // namespace
}  // namespace tsdfpp
