// Experiment files are read strictly, and say the cells that they stand for.
#include "eval/sweep/experiment.h"

#include <gtest/gtest.h>

#include <set>

#include "eval/sweep/cell.h"
#include "eval/sweep/sweep.h"
#include "eval/sweep/sweep_report.h"
#include "eval/sweep/sweep_statistics.h"

namespace tsdfpp {
namespace {

constexpr const char* kGood = R"(name = "good"
question = "Is it read?"
metrics = ["table_preservation_behind_other"]
[[grid]]
scene = "mini.toml"
method = ["tsdf", "anchored"]
)";

Expected<ExperimentConfig> Parse(const std::string& text) {
  return ExperimentConfig::Parse(text, "folder/e.toml");
}

std::string Replaced(std::string text, const std::string& what, const std::string& by) {
  const std::size_t at = text.find(what);
  EXPECT_NE(at, std::string::npos) << what;
  return text.replace(at, what.size(), by);
}

// "0, 1, 2, ..."
std::string Numbers(int count) {
  std::string numbers = "0";
  for (int i = 1; i < count; ++i) numbers += ", " + std::to_string(i);
  return numbers;
}

TEST(Experiment, ReadsWhatItSays) {
  const auto config = Parse(kGood);
  ASSERT_TRUE(config.has_value()) << config.error().message;
  const auto cells = CellsOf(*config);
  ASSERT_EQ(cells.size(), 2U);
  EXPECT_EQ(cells[0].settings.method, "tsdf");
  EXPECT_EQ(cells[1].settings.method, "tsdf++/anchored");
  EXPECT_EQ(cells[1].settings.scene, "mini.toml");
  EXPECT_EQ(cells[1].grid, "1");
}

TEST(Experiment, FaultsGetOneSentenceWithFileLineAndKey) {
  struct Case {
    std::string text;
    std::string sentence;
  };
  const std::string good = kGood;
  const std::vector<Case> cases{
      {Replaced(good, "question", "qestion"), "'question' is missing"},
      {good + "voxel = 0.01\n", "e.toml:7: 'grid.voxel' is not a known key here"},
      {Replaced(good, "table_preservation_behind_other", "kept"),
       "e.toml:3: 'metrics' holds 'kept', expected one of table_preservation_behind_other"},
      {good + "voxel_m = 0\n", "'grid.voxel_m' holds 0, expected a number from 0.0005 to 1"},
      {good + "voxel_m = [0.01, \"b\"]\n", "'grid.voxel_m' holds a string"},
      {good + "voxel_m = []\n", "'grid.voxel_m' is empty"},
      {good + "voxel_m = [0.01, 0.01]\n", "'grid.voxel_m' holds 0.01 twice"},
      {good + "speed = 1.5\n", "'grid.speed' holds 1.5, expected a whole number from 1"},
      {good + "noise = -1\n", "'grid.noise' holds -1, expected a number from 0"},
      {good + "seed = -1\n", "'grid.seed' holds -1, expected a whole number from 0"},
      {good + "layers = 9\n", "'grid.layers' holds 9, expected a whole number from 1 to 8"},
      {good + "sensor = \"kinetc\"\n", "sensor preset 'kinetc' does not exist"},
      {good + "profile = \"near\"\n", "profile 'near' is unknown"},
      {good + "poses = \"slam\"\n", "pose source 'slam' is unknown"},
      {Replaced(good, "\"anchored\"", "\"kinfu\""), "method 'kinfu' is unknown"},
      {Replaced(good, "\"anchored\"", "\"open3d\""),
       "'grid.method' holds 'open3d', expected open3d/N, a band of N voxels on both sides"},
      {Replaced(good, "\"anchored\"", "\"open3d/0.5\""), "holds 'open3d/0.5', expected open3d/N"},
      {Replaced(good, "\"anchored\"", "\"open3d/3x\""), "holds 'open3d/3x', expected open3d/N"},
      {Replaced(good, "\"anchored\"", "\"open3d/3\", \"open3d/3.0\""), "holds open3d/3 twice"},
      {good + "except = [{ method = \"tsdf++\" }]\n",
       "'except' leaves out no further cell of grid"},
      {good + "except = [{ method = [\"tsdf\", \"anchored\"] }]\n",
       "'except' leaves no cell of grid"},
      {good + "except = [{ voxel = 0.01 }]\n", "'grid.except.voxel' is not a known key here"},
      {good + "seed = [" + Numbers(600) + "]\nnoise = [" + Numbers(100) + "]\n",
       "'grid' '1' brings the cells to more than 100000, expected that at most"},
      {Replaced(good, "\"tsdf\"", "\"anchored\""), "holds tsdf++/anchored twice"},
      {Replaced(good, "\"tsdf\"", "\"tsdf++\""), "'baseline' is tsdf, which is not among"},
      {Replaced(good, "scene = \"mini.toml\"\n", ""), "'grid' '1' has no scene"},
      {Replaced(good, "\"good\"", "\"a/b\""), "'name' is 'a/b', expected letters"},
      {Replaced(good, "[[grid]]", "[frames]\nscale = 0\n[[grid]]"), "'frames.scale' is 0"},
      {Replaced(good, "[[grid]]", "[frames]\nuntil = \"now\"\n[[grid]]"),
       "'frames.until' is 'now'"},
      {Replaced(good, "[[grid]]", "[frames]\nuntil = 0\n[[grid]]"), "'frames.until' is 0"},
      {Replaced(good, "[[grid]]", "[statistics]\nconfidence = 95\n[[grid]]"),
       "'statistics.confidence' is 95"},
      {Replaced(good, "[[grid]]", "[plot]\nx = \"voxels\"\n[[grid]]"), "'plot.x' is 'voxels'"},
      {Replaced(good, "[[grid]]", "replicates = [\"method\"]\n[[grid]]"),
       "'replicates' holds 'method'"},
      {good + "[[grid]]\nname = \"1\"\n", "'grid.name' is '1', a second time"},
      {good + "oops", "not valid TOML"},
  };
  for (const Case& c : cases) {
    const auto config = Parse(c.text);
    ASSERT_FALSE(config.has_value()) << c.sentence;
    EXPECT_EQ(config.error().kind, ErrorKind::kUsage);
    EXPECT_NE(config.error().message.find(c.sentence), std::string::npos)
        << config.error().message << "\nexpected: " << c.sentence;
    EXPECT_TRUE(config.error().message.starts_with("folder/e.toml")) << config.error().message;
  }
}

// Each file of eval/experiments is read, and each of its cells fits its scene.
TEST(Experiment, TheReadyOnesFitTheirScenes) {
  int experiments = 0;
  for (const auto& entry :
       std::filesystem::directory_iterator(TSDFPP_SOURCE_DIR "/eval/experiments")) {
    if (entry.path().filename() == "crowd.toml") continue;  // a scene
    const auto config = ExperimentConfig::Load(entry.path());
    ASSERT_TRUE(config.has_value()) << config.error().message;
    EXPECT_EQ(config->name, entry.path().stem());
    EXPECT_TRUE(config->plot.has_value() || config->name == "scenes" || config->name == "baseline")
        << config->name;
    VariantMaker maker(entry.path().parent_path(), config->frames);
    for (const PlannedCell& cell : CellsOf(*config)) {
      // Scenes of other seeds take long to draw and say no more.
      if (cell.settings.seed != 1) continue;
      const auto variant = maker.Make(cell.settings);
      ASSERT_TRUE(variant.has_value()) << config->name << ": " << variant.error().message;
    }
    ++experiments;
  }
  EXPECT_GE(experiments, 11);
}

// Values that are sound one by one; a cell of them has no map.
TEST(Experiment, SettingsThatDoNotGoTogetherAreRefused) {
  const std::vector<std::pair<std::string, std::string>> cases{
      {"method = [\"surfels\", \"tsdf\"]\nposes = \"track\"",
       "grid '1': poses 'track' are tracked by signed distances"},
      {"method = \"tsdf++\"\nsegmentation = \"depth\"",
       "grid '1': segmentation 'depth' gives objects ids of its own"},
      {"method = \"open3d/3\"\nsegmentation = \"full\"", "'open3d/3' has no objects"},
  };
  for (const auto& [settings, sentence] : cases) {
    const auto config = Parse(R"(name = "e"
question = "?"
metrics = ["fuse_ms"]
[[grid]]
scene = "mini.toml"
)" + settings);
    ASSERT_TRUE(config.has_value()) << config.error().message;
    const auto plan = PlanSweep(*config);
    ASSERT_FALSE(plan.has_value()) << settings;
    EXPECT_EQ(plan.error().kind, ErrorKind::kUsage);
    EXPECT_NE(plan.error().message.find(sentence), std::string::npos) << plan.error().message;
  }
}

// Masks whose ids are of one frame alone are no objects' masks.
TEST(Experiment, SensorsThatDrawEveryIdAreRefused) {
  VariantMaker maker(TSDFPP_SOURCE_DIR "/scenes", {});
  CellSettings settings;
  settings.scene = "mini.toml";
  settings.sensor = "masks_mild";
  ASSERT_TRUE(maker.Make(settings).has_value());
  settings.sensor = "masks_redrawn";
  const auto variant = maker.Make(settings);
  ASSERT_FALSE(variant.has_value());
  EXPECT_EQ(variant.error().kind, ErrorKind::kUsage);
  EXPECT_NE(variant.error().message.find("draws the ids of masks anew in every frame"),
            std::string::npos)
      << variant.error().message;
}

TEST(Experiment, CellsAreAllCombinationsGridByGrid) {
  const auto config = Parse(R"(name = "e"
question = "?"
metrics = ["fuse_ms"]
[common]
seed = [3, 4]
voxel_m = 0.02
[[grid]]
scene = ["a.toml", "b.toml"]
method = ["tsdf", "tsdf++"]
voxel_m = [0.01, 0.02, 0.03]
[[grid]]
name = "alone"
scene = "a.toml"
method = "open3d/10"
)");
  ASSERT_TRUE(config.has_value()) << config.error().message;
  const auto cells = CellsOf(*config);
  ASSERT_EQ(cells.size(), 2U * 2U * 2U * 3U + 2U);
  std::set<std::string> different;
  for (const PlannedCell& cell : cells) {
    different.insert(cell.grid + SettingsJson(cell.settings).dump());
  }
  EXPECT_EQ(different.size(), cells.size());
  EXPECT_EQ(cells.front().settings.voxel_m, 0.01);
  EXPECT_EQ(cells[1].settings.voxel_m, 0.02);
  EXPECT_EQ(cells.back().settings.seed, 4U);
  EXPECT_EQ(cells.back().settings.voxel_m, 0.02);
  EXPECT_TRUE(cells.back().settings.is_open3d());
}

// Of "open3d/3" in `paper` and of tsdf++ there as well.
TEST(Experiment, ExceptionsLeaveCombinationsOut) {
  const auto config = Parse(R"(name = "e"
question = "?"
metrics = ["fuse_ms"]
[common]
method = ["tsdf", "tsdf++", "open3d/3", "open3d/10"]
profile = ["paper", "close"]
except = [{ method = "open3d/3", profile = "paper" }]
[[grid]]
scene = "a.toml"
[[grid]]
scene = "b.toml"
except = [{ method = ["tsdf++", "open3d/10"], profile = "paper" }]
)");
  ASSERT_TRUE(config.has_value()) << config.error().message;
  std::multiset<std::string> made;
  for (const PlannedCell& cell : CellsOf(*config)) {
    made.insert(cell.settings.scene + " " + cell.settings.profile + " " + cell.settings.method);
  }
  EXPECT_EQ(made, (std::multiset<std::string>{
                      "a.toml paper tsdf", "a.toml paper tsdf++", "a.toml paper open3d/10",
                      "a.toml close tsdf", "a.toml close tsdf++", "a.toml close open3d/3",
                      "a.toml close open3d/10", "b.toml paper tsdf", "b.toml close tsdf",
                      "b.toml close tsdf++", "b.toml close open3d/3", "b.toml close open3d/10"}));
}

// A cell's id changes with program, renderer, frames and map, and with nothing else.
TEST(Experiment, ACellIsNamedAfterAllThatDeterminesIt) {
  SequenceVariant variant;
  variant.scene_text = "scene";
  variant.frames = {2, 4, 6};
  variant.evaluated = {6};
  variant.examined = 6;
  const CellSettings settings;
  const Cell cell = MakeCell(settings, variant, "p", "r");
  std::set<std::string> ids{cell.id};
  const auto expect_new = [&](const Cell& other, const char* what) {
    EXPECT_TRUE(ids.insert(other.id).second) << what;
  };
  expect_new(MakeCell(settings, variant, "q", "r"), "program");
  expect_new(MakeCell(settings, variant, "p", "s"), "renderer");
  SequenceVariant other = variant;
  other.scene_text = "scene two";
  expect_new(MakeCell(settings, other, "p", "r"), "scene");
  other = variant;
  other.frames = {2, 6};
  expect_new(MakeCell(settings, other, "p", "r"), "frames");
  other = variant;
  other.evaluated = {4, 6};
  expect_new(MakeCell(settings, other, "p", "r"), "evaluations");
  other = variant;
  other.fuse_until = 4;
  expect_new(MakeCell(settings, other, "p", "r"), "fuse_until");
  other = variant;
  other.object_error = 1;
  expect_new(MakeCell(settings, other, "p", "r"), "object_error");
  CellSettings coarse;
  coarse.voxel_m = 0.02;
  const Cell on_same_frames = MakeCell(coarse, variant, "p", "r");
  expect_new(on_same_frames, "voxel size");
  EXPECT_EQ(on_same_frames.sequence, cell.sequence);
  CellSettings renamed;
  renamed.scene = "another name of the same scene";
  EXPECT_EQ(MakeCell(renamed, variant, "p", "r").id, cell.id);
}

// Of an experiment of kGood, with one metric.
void AddCell(SweepResult& result, const CellSettings& settings, std::optional<double> value) {
  CellResult cell;
  cell.examined.assign(SweepMetrics().size(), Measured::Undefined("not asked"));
  cell.examined[0] = value ? Measured::Of(*value) : Measured::Undefined("nothing hidden");
  result.entries.push_back({"1", MakeCell(settings, SequenceVariant{}, "p", "r"), cell});
}

// Two methods on three seeds, one value of one method undefined: means over what is there, pairs
// where both are; checked by hand.
TEST(Experiment, ComparesPairByPair) {
  SweepResult result;
  auto config = Parse(kGood);
  ASSERT_TRUE(config.has_value());
  result.config = *config;
  const auto add = [&](const char* method, std::uint64_t seed, std::optional<double> value) {
    CellSettings settings;
    settings.scene = "mini.toml";
    settings.method = method;
    settings.seed = seed;
    AddCell(result, settings, value);
  };
  add("tsdf", 1, 0.5);
  add("tsdf", 2, 0.6);
  add("tsdf", 3, 0.1);
  add("tsdf++", 1, 0.9);
  add("tsdf++", 2, 0.8);
  add("tsdf++", 3, std::nullopt);
  const auto conditions = ConditionsOf(result);
  ASSERT_EQ(conditions.size(), 1U);
  const Condition& condition = conditions.front();
  EXPECT_EQ(condition.replicates, 3U);
  const std::string metric = SweepMetrics()[0].name;
  EXPECT_NEAR(*condition.means.at({"tsdf", metric}).mean.value, 0.4, 1e-12);
  EXPECT_NEAR(*condition.means.at({"tsdf++", metric}).mean.value, 0.85, 1e-12);
  EXPECT_EQ(condition.means.at({"tsdf++", metric}).count, 2U);
  const PairedComparison& paired = condition.paired.at({"tsdf++", metric});
  EXPECT_EQ(paired.pairs, 2U);
  EXPECT_NEAR(*paired.mean_difference.value, 0.3, 1e-12);
  EXPECT_EQ(*paired.superiority.value, 1.0);
  // With two pairs the bootstrap sees 0.2, 0.3 and 0.4 alone.
  ASSERT_TRUE(paired.interval.value.has_value());
  EXPECT_NEAR(paired.interval.value->low, 0.2, 1e-12);
  EXPECT_NEAR(paired.interval.value->high, 0.4, 1e-12);
  EXPECT_FALSE(condition.paired.contains({"tsdf", metric}));
  const std::string other = SweepMetrics()[1].name;
  EXPECT_EQ(condition.means.at({"tsdf", other}).mean.why_not, "not asked");
}

// Three seeds in three voxel sizes. In 10 mm one value of tsdf++ is undefined, in 20 mm all but
// one, in 40 mm all of both: there nobody knows who is ahead.
TEST(Experiment, TheTextSaysOfHowManyAMeanIsAndWhereNobodyKnows) {
  SweepResult result;
  auto config = Parse(kGood);
  ASSERT_TRUE(config.has_value());
  result.config = *config;
  const auto add = [&](double voxel_m, const char* method,
                       const std::vector<std::optional<double>>& values) {
    CellSettings settings;
    settings.voxel_m = voxel_m;
    settings.method = method;
    for (const std::optional<double>& value : values) {
      ++settings.seed;
      AddCell(result, settings, value);
    }
  };
  add(0.01, "tsdf", {0.5, 0.6, 0.1});
  add(0.01, "tsdf++", {0.9, 0.8, std::nullopt});
  add(0.02, "tsdf", {0.5, 0.4, 0.3});
  add(0.02, "tsdf++", {0.49, std::nullopt, std::nullopt});
  add(0.04, "tsdf", {std::nullopt, std::nullopt, std::nullopt});
  add(0.04, "tsdf++", {std::nullopt, std::nullopt, std::nullopt});
  const std::string text = SweepText(result, ConditionsOf(result));
  EXPECT_NE(text.find(" (of 2 of 3) ("), std::string::npos) << text;
  EXPECT_NE(text.find("tsdf++ 0.490 (of 1 of 3) (-0.010 to tsdf, of one pair)."), std::string::npos)
      << text;
  EXPECT_EQ(text.find("(of 3 of 3)"), std::string::npos) << text;
  EXPECT_NE(text.find("tsdf++ is not ahead of tsdf in hidden table kept (2 of 3): voxel_m 0.02; "
                      "voxel_m 0.04 (undefined).\n"),
            std::string::npos)
      << text;
  // Of those that nobody can compare none is ahead.
  result.entries.erase(result.entries.begin(), result.entries.end() - 6);
  const std::string unknown = SweepText(result, ConditionsOf(result));
  EXPECT_EQ(unknown.find("everywhere"), std::string::npos) << unknown;
}

}  // namespace
}  // namespace tsdfpp
