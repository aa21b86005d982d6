#include "eval/gate/gate_config.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "core/files.h"
#include "eval/gate/gate_reference.h"
#include "eval/sweep/sabotage.h"
#include "tests/core/temp_folder.h"

namespace tsdfpp {
namespace {

constexpr const char* kExperiment = R"(
name = "small"
question = "Does it work?"
metrics = ["movers_completion"]
replicates = ["seed"]
[[grid]]
scene = "mini.toml"
seed = [1, 2, 3]
method = ["tsdf", "tsdf++"]
profile = ["paper", "close"]
)";

// Line 1 is the first one.
constexpr const char* kGates = R"([[experiment]]
name = "small"
file = "small.toml"
profiles = ["quick"]
[[control]]
name = "agree"
experiment = "small"
metric = "visible_completion"
where = { profile = "close" }
methods = ["tsdf", "tsdf++"]
spread = 0.01
min = 0.9
why = "they map the same frames"
[[gate]]
name = "completion"
experiment = "small"
metric = "movers_completion"
where = { method = "tsdf++", profile = "close" }
min = 0.5
why = "half of it is seen"
[[gate]]
name = "size"
experiment = "small"
metric = "map_mb"
where = { method = "tsdf++", profile = "close" }
against = { method = "tsdf" }
ratio = true
max = 2
confidence = 1
why = "two volumes"
[[gate]]
name = "as-before"
experiment = "small"
metric = "movers_completion"
where = { method = "tsdf", profile = "paper" }
tolerance = 0.02
why = "the spread over seeds"
[[sabotage]]
name = "frozen-object"
caught_by = ["completion"]
)";

class GateConfigTest : public ::testing::Test {
 protected:
  void SetUp() override { ASSERT_TRUE(WriteFile(folder_.path() / "small.toml", kExperiment)); }
  Expected<GatesConfig> Parse(const std::string& text) const {
    return GatesConfig::Parse(text, folder_.path() / "gates.toml");
  }
  // The error of kGates with `old` replaced, without the folder.
  std::string ErrorOf(const std::string& old, const std::string& text) const {
    std::string changed = kGates;
    const std::size_t at = changed.find(old);
    if (at == std::string::npos) return "the text to replace is not there";
    const auto parsed = Parse(changed.replace(at, old.size(), text));
    if (parsed) return "no error";
    EXPECT_EQ(parsed.error().kind, ErrorKind::kUsage);
    const std::string folder = folder_.path().string() + "/";
    std::string message = parsed.error().message;
    for (std::size_t i = message.find(folder); i != std::string::npos; i = message.find(folder)) {
      message.erase(i, folder.size());
    }
    return message;
  }
  test::TempFolder folder_;
};

TEST_F(GateConfigTest, ReadsAllKinds) {
  const auto config = Parse(kGates);
  ASSERT_TRUE(config.has_value()) << config.error().message;
  ASSERT_EQ(config->gates.size(), 3U);
  EXPECT_EQ(config->gates[0].kind, Gate::Kind::kAbsolute);
  EXPECT_EQ(config->gates[0].bounds, (Bounds{0.5, {}}));
  EXPECT_EQ(config->gates[1].kind, Gate::Kind::kPaired);
  EXPECT_TRUE(config->gates[1].ratio);
  EXPECT_EQ(config->gates[2].kind, Gate::Kind::kReference);
  EXPECT_EQ(config->gates[2].bounds, (Bounds{-0.02, 0.02}));
  EXPECT_EQ(config->references.filename(), "gates-references.json");
  EXPECT_TRUE(config->IsIn("small", "quick"));
  EXPECT_FALSE(config->IsIn("small", "full"));
  const auto cells = ChosenCells(config->experiments[0].config, config->gates[0].where, {});
  ASSERT_TRUE(cells.has_value());
  EXPECT_EQ(cells->size(), 3U);
  for (const auto& [replicate, settings] : *cells) {
    EXPECT_EQ(settings.method, "tsdf++") << replicate;
    EXPECT_EQ(settings.profile, "close") << replicate;
  }
}

// What a stranger gets wrong, and the sentence for it.
TEST_F(GateConfigTest, WrongFilesGetASentenceWithFileAndLine) {
  const auto begins = [&](const std::string& old, const std::string& text,
                          const std::string& sentence) {
    EXPECT_EQ(ErrorOf(old, text).substr(0, sentence.size()), sentence) << old << " -> " << text;
  };
  begins("metric = \"movers_completion\"", "metric = \"movers_complete\"",
         "gates.toml:17: 'gate.metric' is 'movers_complete', expected one of table_preservation");
  begins("file = \"small.toml\"", "file = \"large.toml\"",
         "gates.toml:3: 'experiment.file' is 'large.toml', but there is no file large.toml");
  begins("experiment = \"small\"\nmetric = \"movers", "experiment = \"large\"\nmetric = \"movers",
         "gates.toml:16: 'gate.experiment' is 'large', expected one of small");
  begins("min = 0.5", "min = 1.5",
         "gates.toml:19: 'gate.min' is 1.5, but movers_completion is from 0 to 1: it can never "
         "hold");
  begins("min = 0.5", "min = 0.7\nmax = 0.6",
         "gates.toml:19: 'gate.min' is 0.7, more than max, which is 0.6: nothing is both");
  begins("min = 0.5", "min = 0",
         "gates.toml:19: 'gate.min' can never be missed: movers_completion is always from 0 to 1");
  begins("min = 0.5", "", "gates.toml:15: 'gate.name' is 'completion', but there is no bound");
  begins("name = \"size\"", "name = \"completion\"",
         "gates.toml:22: 'gate.name' is 'completion', a second time");
  begins("name = \"size\"", "name = \"agree\"", "gates.toml:22: 'gate.name' is 'agree', a second");
  begins("name = \"size\"", "name = \"../size\"",
         "gates.toml:22: 'gate.name' is '../size', expected letters, digits, - and _");
  begins("tolerance = 0.02", "tolerance = -1",
         "gates.toml:36: 'gate.tolerance' is -1, expected above 0");
  begins("tolerance = 0.02", "tolerance = 1",
         "gates.toml:36: 'gate.tolerance' is 1: it can never be missed");
  begins("tolerance = 0.02", "tolerance = 0.02\nmin = 0.1",
         "gates.toml:36: 'gate.tolerance' is two-sided");
  begins("where = { method = \"tsdf++\", profile = \"close\" }\nmin", "min",
         "gates.toml:14: 'gate.where' leaves cells that differ in profile (paper and close)");
  begins("where = { method = \"tsdf\", ", "where = { method = \"volumes\", ",
         "gates.toml:35: 'gate.where' (method volumes, profile paper) leaves no cell");
  begins("profiles = [\"quick\"]", "profiles = [\"fast\"]",
         "gates.toml:4: 'experiment.profiles' holds 'fast', expected quick or full");
  begins("why = \"half of it is seen\"", "", "gates.toml:14: 'gate.why' is missing");
  begins("confidence = 1", "confidence = 1.5",
         "gates.toml:29: 'gate.confidence' is 1.5, expected above 0, at most 1");
  begins("ratio = true\n", "", "gates.toml:24: 'gate.metric' is 'map_mb', a size");
  begins("metric = \"map_mb\"", "metric = \"fuse_ms\"\nunknown = 1",
         "gates.toml:25: 'gate.unknown' is not a known key");
  begins(
      "metric = \"map_mb\"\nwhere = { method = \"tsdf++\", profile = \"close\" }\nagainst = { "
      "method = \"tsdf\" }\nratio = true",
      "metric = \"fuse_ms\"\nwhere = { method = \"tsdf++\", profile = \"close\" }",
      "gates.toml:24: 'gate.metric' is 'fuse_ms', a time");
  begins("name = \"frozen-object\"", "name = \"frozen\"",
         "gates.toml:39: 'sabotage.name' is 'frozen', expected one of none, object-pose");
  begins("caught_by = [\"completion\"]", "caught_by = [\"complete\"]",
         "gates.toml:40: 'sabotage.caught_by' holds 'complete', which is no gate of this file");
  begins("min = 0.9\n", "", "gates.toml:6: 'control.name' is 'agree', but there is neither min");
  begins("methods = [\"tsdf\", \"tsdf++\"]", "methods = [\"tsdf\", \"volumes\"]",
         "gates.toml:10: 'control.methods' (method volumes, profile close) leaves no cell");
  begins("methods = [\"tsdf\", \"tsdf++\"]", "methods = [\"tsdf\", \"tsdf\"]",
         "gates.toml:10: 'control.methods' holds tsdf twice, which agrees with itself");
  begins("against = { method = \"tsdf\" }", "against = { method = \"tsdf++\" }",
         "gates.toml:26: 'gate.against' (method tsdf++) leaves the gate's own cells");
  begins("name = \"frozen-object\"", "name = \"none\"",
         "gates.toml:39: 'sabotage.name' is 'none', which breaks nothing");
  EXPECT_NE(ErrorOf("[[sabotage]]", "[[sabotages]]").find("'sabotages' is not a known key"),
            std::string::npos);
}

// Other words for the same cells: a method's short name, and a setting that the method has not.
TEST_F(GateConfigTest, NothingIsComparedWithItselfInOtherWords) {
  std::string experiment = kExperiment;
  const std::string methods = "\"tsdf++\"]";
  experiment.replace(experiment.find(methods), methods.size(),
                     "\"tsdf++\", \"tsdf++/anchored\"]\nvote_band = [50, 100]");
  ASSERT_TRUE(WriteFile(folder_.path() / "small.toml", experiment));
  const std::string head = std::string(kGates).substr(0, std::string(kGates).find("[[control]]"));
  const auto error = [&](const std::string& text) {
    const auto parsed = Parse(head + text);
    return parsed ? "no error" : parsed.error().message;
  };
  const std::string control = R"([[control]]
name = "agree"
experiment = "small"
metric = "visible_completion"
where = { profile = "close", vote_band = 50 }
methods = ["anchored", "tsdf++/anchored"]
spread = 0.01
min = 0.9
why = "they are one"
)";
  EXPECT_NE(error(control).find("'control.methods' holds tsdf++/anchored twice"), std::string::npos)
      << error(control);
  const auto gate = [](const std::string& method) {
    return fmt::format(R"([[gate]]
name = "pays"
experiment = "small"
metric = "visible_completion"
where = {{ method = "{}", profile = "close", vote_band = 50 }}
against = {{ vote_band = 100 }}
min = -0.01
why = "not worse"
)",
                       method);
  };
  EXPECT_NE(
      error(gate("tsdf++")).find("'gate.against' (vote_band 100) leaves the gate's own cells"),
      std::string::npos)
      << error(gate("tsdf++"));
  EXPECT_EQ(error(gate("tsdf")), "no error");
}

TEST_F(GateConfigTest, AWrongExperimentIsNamedByItsOwnFile) {
  ASSERT_TRUE(WriteFile(folder_.path() / "small.toml", "name = 3\n"));
  const auto parsed = Parse(kGates);
  ASSERT_FALSE(parsed.has_value());
  EXPECT_NE(parsed.error().message.find("small.toml:1: 'name' is an integer"), std::string::npos)
      << parsed.error().message;
}

// Of the project's own gates: each thing that can be broken has a gate that must notice, and no
// baseline can get worse (or better) unseen, which would move a claim against it.
TEST(OwnGates, EverySabotageAndEveryBaselineHasAGate) {
  const auto config =
      GatesConfig::Load(std::filesystem::path(TSDFPP_SOURCE_DIR) / "results" / "gates.toml");
  ASSERT_TRUE(config.has_value()) << config.error().message;
  for (const Sabotage sabotage : Sabotages()) {
    EXPECT_TRUE(std::any_of(config->sabotages.begin(), config->sabotages.end(),
                            [&](const auto& of) { return of.name == SabotageName(sabotage); }))
        << SabotageName(sabotage);
  }
  const auto two_sided = [&](const std::string& experiment, const std::string& metric,
                             const std::string& method, const std::string& profile) {
    const AxisChoice where{{"method", method}, {"profile", profile}};
    return std::any_of(config->gates.begin(), config->gates.end(), [&](const Gate& gate) {
      return gate.kind == Gate::Kind::kReference && gate.experiment == experiment &&
             gate.metric == metric && gate.where == where;
    });
  };
  for (const char* experiment : {"mini", "toycar3"}) {
    for (const char* method : {"tsdf", "tsdf/guarded", "tsdf/static", "tsdf++", "volumes"}) {
      for (const char* metric : {"table_preservation_behind_other", "movers_completion"}) {
        EXPECT_TRUE(two_sided(experiment, metric, method, "paper"))
            << experiment << " " << metric << " " << method;
      }
    }
    for (const char* profile : {"paper", "close"}) {
      EXPECT_TRUE(two_sided(experiment, "ghost_area_cm2", "tsdf++/anchored", profile))
          << experiment << " " << profile;
    }
  }
}

// A reference of another question is none: the frames of an experiment may not change without it.
TEST(OwnGates, ReferencesAreOfTheQuestionsThatGatesAsk) {
  const auto config =
      GatesConfig::Load(std::filesystem::path(TSDFPP_SOURCE_DIR) / "results" / "gates.toml");
  ASSERT_TRUE(config.has_value()) << config.error().message;
  const auto references = LoadReferences(config->references);
  ASSERT_TRUE(references.has_value()) << references.error().message;
  for (const Gate& gate : config->gates) {
    if (gate.kind != Gate::Kind::kReference) continue;
    ASSERT_TRUE(references->contains(gate.name)) << gate.name;
    EXPECT_EQ(references->at(gate.name).question, QuestionOf(gate)) << gate.name;
    const auto cells = ChosenCells(config->FindExperiment(gate.experiment)->config, gate.where, {});
    for (const auto& [replicate, settings] : *cells) {
      EXPECT_TRUE(references->at(gate.name).values.contains(replicate)) << gate.name << replicate;
    }
  }
}

}  // namespace
}  // namespace tsdfpp
