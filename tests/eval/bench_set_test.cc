// The frozen benchmark is what it was, and a leaderboard takes sound results alone.
#include "eval/sweep/bench_set.h"

#include <gtest/gtest.h>

#include <array>
#include <set>

#include "core/files.h"
#include "eval/sweep/bench_result.h"
#include "mapper/method_info.h"
#include "sequence/sequence_json.h"
#include "sim/load_scene.h"
#include "tests/cli/run_command.h"
#include "tests/core/temp_folder.h"
#include "tests/eval/tiny_scene.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr const char* kSets = TSDFPP_SOURCE_DIR "/eval/bench-sets";

// A set of two tiny scenes, frozen.
class SmallSet : public testing::Test {
 protected:
  void SetUp() override {
    ASSERT_TRUE(WriteFile(folder_ / "sets/s/a.toml", test::TinyScene(4)).has_value());
    ASSERT_TRUE(WriteFile(folder_ / "sets/s/b.toml", test::TinyScene(5)).has_value());
    Write({{"a", "a.toml", "?", "?"}, {"b", "b.toml", "?", "?"}});
    auto set = BenchSet::Load(folder_ / "sets", "s");
    ASSERT_TRUE(set.has_value()) << set.error().message;
    std::vector<BenchSequence> hashed;
    for (const BenchSequence& sequence : set->sequences) {
      const auto now = HashSequence(*set, sequence);
      ASSERT_TRUE(now.has_value()) << now.error().message;
      hashed.push_back(*now);
    }
    Write(hashed);
    set_ = *BenchSet::Load(folder_ / "sets", "s");
  }
  void Write(const std::vector<BenchSequence>& sequences) {
    std::string text =
        "name = \"s\"\nscale = 1\nvoxel_m = 0.02\ntrunc_front = 10\ntrunc_back = 3\n"
        "metrics = [\"visible_completion\", \"ghost_area_cm2\"]\n";
    for (const BenchSequence& s : sequences) {
      text += fmt::format(
          "[[sequence]]\nname = \"{}\"\nscene = \"{}\"\nscene_hash = \"{}\"\ntruth_hash = \"{}\"\n",
          s.name, s.scene, s.scene_hash, s.truth_hash);
    }
    ASSERT_TRUE(WriteFile(folder_ / "sets/s/set.toml", text).has_value());
  }
  // Each with a part of set.toml, what is put in its place, and how the sentence begins then.
  void ExpectRefused(const std::vector<std::array<std::string, 3>>& cases) {
    const fs::path file = folder_ / "sets/s/set.toml";
    const std::string good = ReadFile(file).value();
    for (const auto& [old, text, sentence] : cases) {
      std::string changed = good;
      changed.replace(changed.find(old), old.size(), text);
      ASSERT_TRUE(WriteFile(file, changed).has_value());
      const auto set = BenchSet::Load(folder_ / "sets", "s");
      ASSERT_FALSE(set.has_value()) << text;
      EXPECT_EQ(set.error().kind, ErrorKind::kUsage);
      EXPECT_NE(set.error().message.find("set.toml" + sentence), std::string::npos)
          << set.error().message;
    }
    ASSERT_TRUE(WriteFile(file, good).has_value());
  }
  json Result(const std::string& method, double a, double b) const {
    const auto entry = [](const char* sequence, double score) {
      return json{{"sequence", sequence},
                  {"scores",
                   {{"visible_completion", score},
                    {"ghost_area_cm2", {{"value", nullptr}, {"why", "not asked"}}}}}};
    };
    return {{"schema", 1},
            {"kind", "tsdfpp bench result"},
            {"bench_set", "s"},
            {"bench_hash", set_.hash},
            {"method", {{"name", method}, {"version", "1"}, {"commit", "c"}}},
            {"hardware", {{"cpu", "x"}, {"cores", 2}, {"memory_gb", 8}, {"gpu", "none used"}}},
            {"entries", {entry("a", a), entry("b", b)}}};
  }
  test::TempFolder folder_;
  BenchSet set_;
};

TEST(BenchSetV1, IsAsFrozen) {
  const auto set = BenchSet::Load(kSets, "v1");
  ASSERT_TRUE(set.has_value()) << set.error().message;
  // Changed? Then it is another benchmark: make a v2.
  EXPECT_EQ(set->hash, "6aa9378dd63e2bff");
  EXPECT_EQ(set->sequences.size(), 13U);
  const auto frozen = CheckFrozen(*set);
  EXPECT_TRUE(frozen.has_value()) << frozen.error().message;
}

// The scenes that are run are the ones whose hashes were compared, their seeds too.
TEST(BenchSetV1, RunsTheScenesThatAreFrozen) {
  const auto set = BenchSet::Load(kSets, "v1");
  ASSERT_TRUE(set.has_value()) << set.error().message;
  const auto config = ExperimentOf(*set, {"tsdf"});
  ASSERT_TRUE(config.has_value()) << config.error().message;
  const auto cells = CellsOf(*config);
  ASSERT_EQ(cells.size(), set->sequences.size());
  std::set<std::uint64_t> seeds;
  for (std::size_t i = 0; i < cells.size(); ++i) {
    const CellSettings& settings = cells[i].settings;
    const auto scene = LoadSceneConfig(set->file.parent_path() / settings.scene, settings.seed);
    ASSERT_TRUE(scene.has_value()) << scene.error().message;
    EXPECT_EQ(HashText(SceneToToml(*scene)), set->sequences[i].scene_hash) << cells[i].grid;
    seeds.insert(settings.seed);
  }
  EXPECT_TRUE(seeds.contains(101)) << "of random-101";
}

TEST_F(SmallSet, EachSceneHasItsOwnSeed) {
  ASSERT_TRUE(WriteFile(folder_ / "sets/s/b.toml", "seed = 7\n" + test::TinyScene(5)).has_value());
  const auto config = ExperimentOf(set_, {"tsdf"});
  ASSERT_TRUE(config.has_value()) << config.error().message;
  const auto cells = CellsOf(*config);
  ASSERT_EQ(cells.size(), 2U);
  EXPECT_EQ(cells[0].settings.seed, 1U);
  EXPECT_EQ(cells[1].settings.seed, 7U);
  const fs::path file = folder_ / "sets/s/b.toml";
  ASSERT_TRUE(WriteFile(file, "seed = 9007199254740993\n" + test::TinyScene(5)).has_value());
  const auto large = ExperimentOf(set_, {"tsdf"});
  ASSERT_FALSE(large.has_value());
  EXPECT_EQ(large.error().message,
            file.string() +
                ": 'seed' is 9007199254740993, expected 0 to 9007199254740992 in a "
                "scene of a benchmark");
}

TEST_F(SmallSet, ValuesThatNoMapHasAreRefused) {
  ExpectRefused(
      {{"voxel_m = 0.02", "voxel_m = 5.0", ":3: 'voxel_m' holds 5, expected a number from 0.0005"},
       {"voxel_m = 0.02", "voxel_m = 1e-9", ":3: 'voxel_m' holds 1e-09, expected a number"},
       {"trunc_front = 10", "trunc_front = 0.5",
        ":4: 'trunc_front' holds 0.5, expected a number from 1 to 100"},
       {"trunc_back = 3", "trunc_back = 101", ":5: 'trunc_back' holds 101, expected a number"},
       {"scale = 1", "scale = 0", ":2: 'scale' is 0, expected a number from 0.05 to 4"}});
}

// What no result could be of is said before the hours that one takes.
TEST_F(SmallSet, NamesAreThereOnceAndTheSetHasItsFoldersName) {
  ExpectRefused({{"name = \"b\"", "name = \"a\"", ":13: 'sequence.name' is 'a', a second time"},
                 {"\"ghost_area_cm2\"", "\"visible_completion\"",
                  ":6: 'metrics' holds 'visible_completion' twice"},
                 {"name = \"s\"", "name = \"v1\"",
                  ":1: 'name' is 'v1', expected 's', as the folder is called"}});
  EXPECT_TRUE(BenchSet::Load(folder_ / "sets", "s/").has_value());
}

TEST_F(SmallSet, WhatIsNotAsFrozenIsNamed) {
  EXPECT_TRUE(CheckFrozen(set_).has_value());
  // The same text with a space in a comment is the same scene; a car that drives otherwise is not.
  ASSERT_TRUE(WriteFile(folder_ / "sets/s/b.toml", "# again\n" + test::TinyScene(5)).has_value());
  EXPECT_TRUE(CheckFrozen(set_).has_value());
  std::string other = test::TinyScene(5);
  other.replace(other.find("x = [0.02, 0.18]"), 16, "x = [0.02, 0.19]");
  ASSERT_TRUE(WriteFile(folder_ / "sets/s/b.toml", other).has_value());
  const auto checked = CheckFrozen(set_);
  ASSERT_FALSE(checked.has_value());
  EXPECT_EQ(checked.error().kind, ErrorKind::kData);
  EXPECT_NE(checked.error().message.find("sequence b"), std::string::npos);
  const auto none = BenchSet::Load(folder_ / "sets", "v9");
  ASSERT_FALSE(none.has_value());
  EXPECT_NE(none.error().message.find("expected one of: s"), std::string::npos);
}

TEST_F(SmallSet, TheExperimentHasItsSettings) {
  const auto config = ExperimentOf(set_, {"tsdf", "anchored"});
  ASSERT_TRUE(config.has_value());
  const auto cells = CellsOf(*config);
  ASSERT_EQ(cells.size(), 4U);
  EXPECT_EQ(cells[1].settings.method, "tsdf++/anchored");
  EXPECT_EQ(cells[1].settings.voxel_m, 0.02);
  EXPECT_EQ(cells[1].settings.trunc_back, 3);
  EXPECT_FALSE(ExperimentOf(set_, {"kinfu"}).has_value());
  EXPECT_FALSE(ExperimentOf(set_, {}).has_value());
  // Its band is not the set's, and it has no labels.
  const auto open3d = ExperimentOf(set_, {"tsdf", "open3d/3"});
  ASSERT_FALSE(open3d.has_value());
  EXPECT_EQ(open3d.error().message,
            "method 'open3d/3' is unknown, expected one of " + MethodNames());
  EXPECT_FALSE(ExperimentOf(set_, {"anchored", "tsdf", "tsdf++/anchored"}).has_value());
}

TEST_F(SmallSet, ALeaderboardIsBestFirst) {
  ASSERT_TRUE(WriteFile(folder_ / "r/1.json", Result("good", 0.9, 0.7).dump()).has_value());
  ASSERT_TRUE(WriteFile(folder_ / "r/2.json", Result("best", 1, 0.8).dump()).has_value());
  const auto page = Leaderboard(set_, folder_ / "r");
  ASSERT_TRUE(page.has_value()) << page.error().message;
  const std::size_t best = page->find("| best | 0.900 [0.800, 1.000] | - |");
  const std::size_t good = page->find("| good | 0.800 [0.700, 0.900] | - |");
  ASSERT_NE(best, std::string::npos) << *page;
  ASSERT_NE(good, std::string::npos) << *page;
  EXPECT_LT(best, good);
  // The easier half says nothing of the other.
  json half = Result("half", 1, 1);
  half["entries"][1]["scores"]["visible_completion"] = {{"value", nullptr}, {"why", "it crashed"}};
  ASSERT_TRUE(WriteFile(folder_ / "r/3.json", half.dump()).has_value());
  const auto with_half = Leaderboard(set_, folder_ / "r");
  ASSERT_TRUE(with_half.has_value()) << with_half.error().message;
  const std::size_t last = with_half->find("| half | 1.000");
  ASSERT_NE(last, std::string::npos) << *with_half;
  EXPECT_LT(with_half->find("| good | 0.800"), last);
  EXPECT_NE(with_half->find(" (of 1 of 2) |", last), std::string::npos) << *with_half;
  EXPECT_NE(page->find("| best | 1.000 | 0.800 |"), std::string::npos) << *page;
}

// The areas of a share are summed in another order than those of the whole.
TEST_F(SmallSet, AWholeShareMayBeARoundingAboveOne) {
  ASSERT_TRUE(
      WriteFile(folder_ / "r/1.json", Result("whole", 1, 1.0000000000000002).dump()).has_value());
  const auto page = Leaderboard(set_, folder_ / "r");
  ASSERT_TRUE(page.has_value()) << page.error().message;
  EXPECT_NE(page->find("| whole | 1.000 | 1.000 |"), std::string::npos) << *page;
}

// Whoever wrote a result does not write the page.
TEST_F(SmallSet, TextsOfResultsStayTexts) {
  json result = Result("a|b <script>x</script> [c](d)\n# e", 1, 1);
  ASSERT_TRUE(WriteFile(folder_ / "r/1.json", result.dump()).has_value());
  const auto page = Leaderboard(set_, folder_ / "r");
  ASSERT_TRUE(page.has_value()) << page.error().message;
  EXPECT_NE(page->find("| a\\|b \\<script\\>x\\</script\\> \\[c\\](d) # e |"), std::string::npos)
      << *page;
  EXPECT_EQ(page->find("\n# e"), std::string::npos);
}

TEST_F(SmallSet, OurMethodsRunOnItAndEnterThePage) {
  const std::vector<std::string> of_set{"bench-set", "s", "--sets", folder_ / "sets"};
  const auto run = [&](std::vector<std::string> more) {
    more.insert(more.begin(), of_set.begin(), of_set.end());
    return test::RunTsdfpp(more, folder_.path());
  };
  const auto ran = run({"--run", "tsdf,anchored", "--commit", "abc", "--out", folder_ / "r"});
  ASSERT_EQ(ran.exit_code, 0) << ran.err;
  const auto result = ReadBenchResult(set_, folder_ / "r/tsdf++-anchored.json");
  ASSERT_TRUE(result.has_value()) << result.error().message;
  EXPECT_EQ(result->commit, "abc");
  EXPECT_GT(*result->scores.at("b").at("visible_completion").value, 0.5);
  const auto page = run({"--leaderboard", folder_ / "r", "--out", folder_ / "page.md"});
  ASSERT_EQ(page.exit_code, 0) << page.err;
  EXPECT_NE(ReadFile(folder_ / "page.md")->find("| tsdf++/anchored | "), std::string::npos);
  // The same command replaces its own results.
  const auto again = run({"--run", "tsdf,anchored", "--commit", "d", "--out", folder_ / "r"});
  ASSERT_EQ(again.exit_code, 0) << again.err;
  EXPECT_EQ(ReadBenchResult(set_, folder_ / "r/tsdf.json")->commit, "d");
  EXPECT_EQ(run({}).exit_code, 0);
  EXPECT_EQ(run({"--run", "kinfu", "--out", folder_ / "x"}).exit_code, 2);
}

// A run replaces results of its own methods alone, and writes nothing behind a link.
TEST_F(SmallSet, FilesOfOthersStay) {
  const fs::path out = folder_ / "o";
  const fs::path file = out / "tsdf.json";
  json of_another = Result("tsdf", 1, 1);
  of_another["bench_set"] = "v9";
  json of_nobody = Result("tsdf", 1, 1);
  of_nobody["method"] = "tsdf";
  const std::string mine = "mine";
  for (const std::string& theirs : {mine, json::array().dump(), of_another.dump(), of_nobody.dump(),
                                    Result("better", 1, 1).dump()}) {
    ASSERT_TRUE(WriteFile(file, theirs).has_value());
    const auto place = CheckPlaceOfResult(set_, "tsdf", file);
    ASSERT_FALSE(place.has_value()) << theirs;
    EXPECT_EQ(place.error().message,
              file.string() +
                  ": is of no earlier run and would be replaced, expected another "
                  "folder");
  }
  ASSERT_TRUE(WriteFile(file, Result("tsdf", 1, 1).dump()).has_value());
  EXPECT_TRUE(CheckPlaceOfResult(set_, "tsdf", file).has_value());
  EXPECT_TRUE(CheckPlaceOfResult(set_, "tsdf", out / "new.json").has_value());
  fs::create_symlink(file, out / "link.json");
  EXPECT_FALSE(CheckPlaceOfResult(set_, "tsdf", out / "link.json").has_value());

  const auto refused = [&](const std::string& words) {
    const auto run = test::RunTsdfpp(
        {"bench-set", "s", "--sets", folder_ / "sets", "--run", "anchored,tsdf", "--out", out},
        folder_.path());
    EXPECT_EQ(run.exit_code, test::kUsage) << words << run.err;
    EXPECT_NE(run.err.find(words), std::string::npos) << run.err;
  };
  ASSERT_TRUE(WriteFile(file, mine).has_value());
  refused("tsdf.json: is of no earlier run");
  EXPECT_EQ(ReadFile(file), mine);
  fs::remove(file);
  fs::create_directories(folder_ / "elsewhere");
  fs::create_directory_symlink(folder_ / "elsewhere", out / "work");
  refused("work: is a link, expected a folder or nothing");
  fs::remove(out / "work");
  fs::create_directories(out / "work");
  fs::create_directory_symlink(folder_ / "elsewhere", out / "work/cells");
  refused("cells: is a link, expected a folder or nothing");
  EXPECT_TRUE(fs::is_empty(folder_ / "elsewhere"));
  EXPECT_FALSE(fs::exists(out / "tsdf++-anchored.json"));
}

TEST_F(SmallSet, AnUnsoundResultIsRefusedInASentence) {
  const auto refused = [&](const json& result, const std::string& sentence) {
    EXPECT_TRUE(WriteFile(folder_ / "r/1.json", result.dump()).has_value());
    const auto page = Leaderboard(set_, folder_ / "r");
    ASSERT_FALSE(page.has_value()) << sentence;
    EXPECT_EQ(page.error().kind, ErrorKind::kData);
    EXPECT_NE(page.error().message.find(sentence), std::string::npos) << page.error().message;
    EXPECT_NE(page.error().message.find("1.json"), std::string::npos);
  };
  json result = Result("m", 1, 1);
  result["schema"] = 2;
  refused(result, "no benchmark result of schema 1");
  result = Result("m", 1, 1);
  result["bench_hash"] = "0";
  refused(result, "expected s with");
  result = Result("m", 1, 1);
  result["entries"].erase(1);
  refused(result, "sequence b is missing");
  result = Result("m", 1, 1);
  result["entries"][1]["sequence"] = "a";
  refused(result, "is there twice");
  result = Result("m", 1, 1);
  result["entries"][0]["scores"].erase("ghost_area_cm2");
  refused(result, "metric ghost_area_cm2 of sequence a is missing");
  result = Result("m", 1, 1);
  result["entries"][0]["scores"]["mine"] = 1;
  refused(result, "has 3 metrics, the benchmark 2");
  result = Result("m", 1, 1);
  result["entries"][0]["scores"]["visible_completion"] = nullptr;
  refused(result,
          "visible_completion of sequence \"a\" is null, expected a number or {\"value\": null, "
          "\"why\": \"...\"}");
  for (const json& score :
       {json("1"), json(true), json::array(), json::object(), json{{"value", 1}, {"why", "x"}},
        json{{"value", nullptr}}, json{{"value", nullptr}, {"why", 1}}, json{{"why", "x"}}}) {
    result["entries"][0]["scores"]["visible_completion"] = score;
    refused(result,
            "visible_completion of sequence \"a\" is " + score.dump() + ", expected a number or {");
  }
  for (const json& entry : {json(1), json("a"), json{{"sequence", "a"}},
                            json{{"sequence", 1}, {"scores", json::object()}}}) {
    result["entries"][0] = entry;
    refused(result, "an entry is " + entry.dump() + ", expected an object with the name");
  }
  result = Result("m", 1, 1);
  result["entries"][0]["scores"]["visible_completion"] = 1.5;
  refused(result, "visible_completion of sequence \"a\" is 1.5, expected 0 to 1");
  result = Result("m", 1, 1);
  result["entries"][0]["scores"]["ghost_area_cm2"] = -1;
  refused(result, "ghost_area_cm2 of sequence \"a\" is -1, expected 0 to 1e+15");
  // Two such have no sum.
  result["entries"][0]["scores"]["ghost_area_cm2"] = 1.7e308;
  refused(result, "ghost_area_cm2 of sequence \"a\" is 1.7e+308, expected 0 to 1e+15");
  result = Result("m", 1, 1);
  result["hardware"].erase("cpu");
  refused(result, "a field is missing or wrong");
  refused(json::array(), "not a JSON object");
  EXPECT_FALSE(Leaderboard(set_, folder_ / "none").has_value());
}

}  // namespace
}  // namespace tsdfpp
