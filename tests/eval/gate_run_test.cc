// What gates make of cells, without running any: verdicts, references, reports.
#include "eval/gate/gate_run.h"

#include <gtest/gtest.h>

#include <deque>

#include "core/files.h"
#include "eval/gate/gate_explain.h"
#include "eval/gate/gate_report.h"
#include "eval/gate/gate_times.h"
#include "eval/report/report_gates.h"
#include "eval/sweep/sweep_metrics.h"
#include "tests/core/temp_folder.h"

namespace tsdfpp {
namespace {

constexpr const char* kMetric = "movers_completion";
const BootstrapConfig kStatistics{BootstrapConfig::Method::kPercentile, 0.95, 1000, 1, 0};

CellResult CellWith(const Measured& value) {
  CellResult cell;
  cell.examined.assign(SweepMetrics().size(), Measured::Undefined("not of this test"));
  cell.frames.push_back({40, true, {}, "digest"});
  for (std::size_t i = 0; i < SweepMetrics().size(); ++i) {
    if (SweepMetrics()[i].name == kMetric) cell.examined[i] = value;
  }
  cell.frames[0].values = cell.examined;
  return cell;
}

class GateRunTest : public ::testing::Test {
 protected:
  const CellResult* Cell(double value) {
    return &cells_.emplace_back(CellWith(Measured::Of(value)));
  }
  // ours and theirs of seed 1, 2, ...
  GateData Data(const std::vector<double>& ours, const std::vector<double>& theirs = {}) {
    GateData data;
    for (std::size_t i = 0; i < ours.size(); ++i) {
      data[fmt::format("seed={};", i + 1)] = {Cell(ours[i]),
                                              theirs.empty() ? nullptr : Cell(theirs[i])};
    }
    return data;
  }
  static Gate Of(Gate::Kind kind, Bounds bounds) {
    Gate gate;
    gate.name = "g";
    gate.experiment = "small";
    gate.metric = kMetric;
    gate.kind = kind;
    gate.bounds = bounds;
    return gate;
  }
  static GateReference ReferenceOf(const Gate& gate, const std::vector<double>& values) {
    GateReference reference;
    reference.question = QuestionOf(gate);
    for (std::size_t i = 0; i < values.size(); ++i) {
      reference.values[fmt::format("seed={};", i + 1)] = values[i];
    }
    return reference;
  }
  std::deque<CellResult> cells_;
};

// The spread of the seeds is large and shared by both sides: only the pairs tell.
TEST_F(GateRunTest, PairsAreComparedOnTheirOwnSeed) {
  const Gate gate = Of(Gate::Kind::kPaired, {0.05, {}});
  const auto verdict = [&](const std::vector<double>& ours, const std::vector<double>& theirs) {
    return JudgeGate(gate, Data(ours, theirs), nullptr, kStatistics).verdict;
  };
  EXPECT_EQ(verdict({0.3, 0.6, 0.9}, {0.2, 0.5, 0.8}), Verdict::kPass);
  EXPECT_EQ(verdict({0.3, 0.6, 0.9}, {0.8, 0.2, 0.5}), Verdict::kInconclusive);
  EXPECT_EQ(verdict({0.2, 0.5, 0.8}, {0.2, 0.5, 0.8}), Verdict::kFail);
}

TEST_F(GateRunTest, RatiosToAPeer) {
  Gate gate = Of(Gate::Kind::kPaired, {{}, 2});
  gate.ratio = true;
  EXPECT_EQ(JudgeGate(gate, Data({1, 3, 5}, {1, 2, 3}), nullptr, kStatistics).verdict,
            Verdict::kPass);
  EXPECT_EQ(JudgeGate(gate, Data({5, 7, 9}, {1, 2, 3}), nullptr, kStatistics).verdict,
            Verdict::kFail);
  EXPECT_EQ(JudgeGate(gate, Data({5, 7, 9}, {1, 0, 3}), nullptr, kStatistics).verdict,
            Verdict::kInvalid);
}

// Of each pair of frames, so that a machine that is slow for a while changes nothing.
TEST_F(GateRunTest, TimesAreComparedFrameByFrame) {
  Gate gate = Of(Gate::Kind::kPaired, {{}, 0.5});
  gate.metric = kFrameTimeMetric;
  gate.ratio = true;
  const auto timed = [&](const std::vector<double>& ms, const std::string& run) {
    CellResult& cell = cells_.emplace_back(CellWith(Measured::Undefined("not of this test")));
    cell.examined.assign(SweepMetrics().size(), Measured::Of(1e9));  // must not be looked at
    for (std::size_t i = 0; i < ms.size(); ++i)
      cell.image_digests.emplace(static_cast<int>(10 * i), "d");
    cell.frame_ms = ms;
    cell.timed_in = run;
    return &cell;
  };
  // Theirs: 100 ms, then 1000 ms as something else began to work. Ours takes 0.2 of it but for two
  // frames in which the machine stalled.
  std::vector<double> theirs(12, 100);
  theirs.resize(24, 1000);
  std::vector<double> ours;
  ours.reserve(theirs.size());
  for (const double ms : theirs) ours.push_back(0.2 * ms);
  ours[3] = ours[17] = 5000;
  const auto judge = [&](double factor, const std::string& run, std::size_t frames = 24) {
    std::vector<double> scaled;
    for (std::size_t i = 0; i < frames; ++i) scaled.push_back(factor * ours[i]);
    GateData data;
    for (const char* seed : {"seed=1;", "seed=2;"}) {
      data[seed] = {timed(scaled, run), timed(theirs, "one")};
    }
    return JudgeGate(gate, data, nullptr, kStatistics);
  };
  const Judgement good = judge(1, "one");
  EXPECT_EQ(good.verdict, Verdict::kPass) << good.why;
  EXPECT_NEAR(*good.mean.value, 0.2, 1e-12);
  EXPECT_EQ(judge(3, "one").verdict, Verdict::kFail) << "three times as slow";
  EXPECT_EQ(judge(1, "one", 10).verdict, Verdict::kPass) << "20 frames of two seeds";
  const Judgement few = judge(1, "one", 9);
  EXPECT_EQ(few.verdict, Verdict::kInconclusive);
  EXPECT_EQ(few.why, "18 frames were timed, 20 are needed");
  const Judgement apart = judge(1, "another");
  EXPECT_EQ(apart.verdict, Verdict::kInvalid);
  EXPECT_EQ(apart.why, "seed=1;: the two were not timed in one run");
}

TEST_F(GateRunTest, ReferencesAreTwoSided) {
  const Gate gate = Of(Gate::Kind::kReference, {-0.02, 0.02});
  const GateReference reference = ReferenceOf(gate, {0.5, 0.7, 0.6});
  const auto verdict = [&](const std::vector<double>& ours) {
    return JudgeGate(gate, Data(ours), &reference, kStatistics).verdict;
  };
  EXPECT_EQ(verdict({0.5, 0.7, 0.6}), Verdict::kPass);
  EXPECT_EQ(verdict({0.51, 0.71, 0.61}), Verdict::kPass);
  EXPECT_EQ(verdict({0.45, 0.65, 0.55}), Verdict::kFail);
  EXPECT_EQ(verdict({0.55, 0.75, 0.65}), Verdict::kFail) << "an improvement is to be explained";
}

TEST_F(GateRunTest, FreshSeedsOfAnAuditAreComparedWithTheMean) {
  const Gate gate = Of(Gate::Kind::kReference, {-0.05, 0.05});
  const GateReference reference = ReferenceOf(gate, {0.5, 0.7});
  GateData data;
  data["seed=101;"] = {Cell(0.59), nullptr};
  data["seed=102;"] = {Cell(0.61), nullptr};
  const GateReference fresh = ReferenceOfFreshSeeds(reference, data);
  const Judgement judgement = JudgeGate(gate, data, &fresh, kStatistics);
  EXPECT_EQ(judgement.verdict, Verdict::kPass);
  EXPECT_NEAR(*judgement.mean.value, 0, 1e-12);
  EXPECT_EQ(fresh.values.at("seed=1;"), 0.5);
  EXPECT_TRUE(ReferenceOfFreshSeeds({}, data).values.empty());
}

// The mean of others is no reference of a seed: it would hide what the seed does.
TEST_F(GateRunTest, ASeedThatTheReferenceLacksIsInvalid) {
  const Gate gate = Of(Gate::Kind::kReference, {-0.3, 0.3});
  const GateReference reference = ReferenceOf(gate, {0.5, 0.7});
  const Judgement judgement = JudgeGate(gate, Data({0.5, 0.7, 0.6}), &reference, kStatistics);
  EXPECT_EQ(judgement.verdict, Verdict::kInvalid);
  EXPECT_EQ(judgement.why, "the reference has no value for seed=3;: --update it");
}

TEST_F(GateRunTest, AReferenceOfOtherFramesIsInvalid) {
  Gate gate = Of(Gate::Kind::kReference, {-0.1, 0.1});
  const GateReference reference = ReferenceOf(gate, {0.5, 0.6});
  EXPECT_EQ(JudgeGate(gate, Data({0.5, 0.6}), &reference, kStatistics).verdict, Verdict::kPass);
  gate.frames.stride = 2;
  const Judgement judgement = JudgeGate(gate, Data({0.5, 0.6}), &reference, kStatistics);
  EXPECT_EQ(judgement.verdict, Verdict::kInvalid);
  EXPECT_NE(judgement.why.find("of another question"), std::string::npos) << judgement.why;
}

TEST_F(GateRunTest, MissingDataIsInvalid) {
  const Gate absolute = Of(Gate::Kind::kAbsolute, {0.1, {}});
  GateData data = Data({0.5, 0.6});
  EXPECT_EQ(JudgeGate(absolute, data, nullptr, kStatistics).verdict, Verdict::kPass);
  data["seed=3;"] = {&cells_.emplace_back(CellWith(Measured::Undefined("nothing moved"))), nullptr};
  const Judgement undefined = JudgeGate(absolute, data, nullptr, kStatistics);
  EXPECT_EQ(undefined.verdict, Verdict::kInvalid);
  EXPECT_EQ(undefined.why, "movers_completion is undefined at seed=3;: nothing moved");
  data["seed=3;"] = {nullptr, nullptr};
  EXPECT_EQ(JudgeGate(absolute, data, nullptr, kStatistics).verdict, Verdict::kInvalid);

  const Gate relative = Of(Gate::Kind::kReference, {-0.1, 0.1});
  EXPECT_EQ(JudgeGate(relative, Data({0.5, 0.6}), nullptr, kStatistics).verdict, Verdict::kInvalid);
  GateReference of_another = ReferenceOf(relative, {0.5, 0.6});
  of_another.question = "small: ghost_area_cm2 of method tsdf";
  EXPECT_EQ(JudgeGate(relative, Data({0.5, 0.6}), &of_another, kStatistics).verdict,
            Verdict::kInvalid);
}

// A cell that names no examined frame leaves frame 0 to be explained, which no scene has.
TEST_F(GateRunTest, WithoutAFrameThereIsASentenceAndNoPicture) {
  const test::TempFolder folder;
  ASSERT_TRUE(WriteFile(folder.path() / "small.toml", fmt::format(R"(name = "small"
question = "?"
metrics = ["{0}"]
replicates = ["seed"]
[[grid]]
scene = "{1}/scenes/mini.toml"
seed = 1
method = "tsdf"
)",
                                                                  kMetric, TSDFPP_SOURCE_DIR)));
  const auto config = GatesConfig::Parse(fmt::format(R"([[experiment]]
name = "small"
file = "small.toml"
profiles = ["quick"]
[[gate]]
name = "g"
experiment = "small"
metric = "{}"
min = 0.9
confidence = 1
why = "so"
)",
                                                     kMetric),
                                         folder.path() / "gates.toml");
  ASSERT_TRUE(config.has_value()) << config.error().message;
  GateRun run;
  run.config = *config;
  GateOutcome outcome;
  outcome.gate = config->gates.front();
  outcome.data = Data({0.5});
  cells_.back().frames.clear();
  outcome.judgement = JudgeGate(outcome.gate, outcome.data, nullptr, kStatistics);
  const auto explained = ExplainGate(run, outcome, {}, folder.path());
  ASSERT_FALSE(explained.has_value());
  EXPECT_EQ(explained.error().kind, ErrorKind::kData);
  EXPECT_NE(explained.error().message.find("small.toml: no frame up to 0 is mapped"),
            std::string::npos)
      << explained.error().message;
}

TEST(GateEnvironmentTest, BytesAreExpectedOfTheSameRendererMujocoAndProcessorOnly) {
  const GateEnvironment here{"0.1 a", "llvmpipe 15", "3.17.0", "Xeon"};
  GateEnvironment there = here;
  there.program = "0.2 b";
  EXPECT_TRUE(here.SameBytesExpected(there));
  for (std::string GateEnvironment::*field :
       {&GateEnvironment::renderer, &GateEnvironment::mujoco, &GateEnvironment::machine}) {
    there = here;
    there.*field += " other";
    EXPECT_FALSE(here.SameBytesExpected(there));
  }
}

TEST(ReferencesTest, ComeBackFromTheFile) {
  const test::TempFolder folder;
  GateReference reference;
  reference.question = "small: movers_completion of method tsdf++";
  reference.values = {{"seed=1;", 0.1}, {"seed=2;", 1.0 / 3}};
  reference.map_digests = {{"seed=1;", "abc"}};
  reference.by_frame = {{"seed=1;", {{10, 0.05}, {40, 0.1}}}};
  reference.environment = {"p", "r", "m", "c"};
  reference.command = "tsdfpp gate";
  reference.reason = "first";
  reference.date = "2026-11-21";
  const References references{{"g", reference}};
  const auto file = folder.path() / "gates-references.json";
  ASSERT_TRUE(SaveReferences(references, file));
  const auto loaded = LoadReferences(file);
  ASSERT_TRUE(loaded.has_value()) << loaded.error().message;
  EXPECT_EQ(*loaded, references);
  EXPECT_EQ(ReferencesDifference(references, *loaded), "");

  References changed = references;
  changed["g"].values["seed=2;"] = 0.5;
  changed["h"] = reference;
  const std::string difference = ReferencesDifference(references, changed);
  EXPECT_NE(difference.find("g seed=2; 0.333333 -> 0.5 (+0.167)\n"), std::string::npos)
      << difference;
  EXPECT_NE(difference.find("h: new\n"), std::string::npos) << difference;
  EXPECT_EQ(difference.find("seed=1; 0.1 ->"), std::string::npos) << difference;

  EXPECT_TRUE(LoadReferences(folder.path() / "none.json")->empty());
  for (const char* wrong : {"", "[]", "{\"schema\": 1}", "{\"schema\": 2, \"gates\": {}}",
                            "{\"schema\": 1, \"gates\": {\"g\": {\"question\": 3}}}",
                            "{\"schema\": 1, \"gates\": {\"g\\u001b[31m\": {}}}"}) {
    ASSERT_TRUE(WriteFile(file, wrong));
    const auto refused = LoadReferences(file);
    ASSERT_FALSE(refused.has_value()) << wrong;
    EXPECT_EQ(refused.error().kind, ErrorKind::kData);
    EXPECT_EQ(refused.error().message.rfind(file.string() + ": ", 0), 0U)
        << refused.error().message;
  }
}

GateRun RunOf(Verdict verdict, const std::string& name) {
  GateRun run;
  GateOutcome outcome;
  outcome.gate.name = name;
  outcome.gate.metric = kMetric;
  outcome.gate.bounds = {0.5, {}};
  outcome.judgement = Judge(std::vector<double>{0.4, 0.4}, {0.5, {}}, 0.9, kStatistics);
  outcome.judgement.verdict = verdict;
  outcome.judgement.why = "0.4 < 0.5 & \"low\"";
  run.gates.push_back(outcome);
  return run;
}

TEST(GateReportTest, JUnitIsEscapedAndCounted) {
  const std::string junit = GateJUnit(RunOf(Verdict::kFail, "a<b"));
  EXPECT_NE(junit.find("tests=\"1\" failures=\"1\" errors=\"0\""), std::string::npos) << junit;
  EXPECT_NE(junit.find("name=\"a&lt;b\""), std::string::npos) << junit;
  EXPECT_NE(junit.find("0.4 &lt; 0.5 &amp; &quot;low&quot;"), std::string::npos) << junit;
  EXPECT_NE(GateJUnit(RunOf(Verdict::kInconclusive, "g")).find("failures=\"0\" errors=\"1\""),
            std::string::npos);
  EXPECT_NE(GateJUnit(RunOf(Verdict::kPass, "g")).find("failures=\"0\" errors=\"0\""),
            std::string::npos);
}

TEST(GateReportTest, MarkdownNamesWhatFailsAndBreaksNoTable) {
  const std::string text = GateMarkdown(
      RunOf(Verdict::kFail, "a|b<i>"), {{"a|b<i>", {"seed=1;", 40, "c<u>r", "in words", "p.png"}}});
  EXPECT_NE(text.find("| a\\|b&lt;i&gt; | **fail** |"), std::string::npos) << text;
  EXPECT_NE(text.find("Worst at seed=1; frame 40, c&lt;u&gt;r: ![picture](pictures/p.png)"),
            std::string::npos)
      << text;
  EXPECT_EQ(GateMarkdown(RunOf(Verdict::kPass, "g"), {}).find("**"), std::string::npos);
}

// What the report's page reads is what the gates wrote; else there is a sentence.
TEST(GateReportTest, ResultsComeBackForTheReport) {
  const test::TempFolder folder;
  const auto file = folder.path() / "gates.json";
  GateRun run = RunOf(Verdict::kFail, "g");
  run.sabotages.push_back({Sabotage::kFrozenObject, run.gates});
  ControlOutcome control;
  control.control.name = "c";
  control.control.metric = kMetric;
  control.verdict = Verdict::kPass;
  run.controls.push_back(control);
  ASSERT_TRUE(
      WriteGateReports(run, {{"g", {"seed=1;", 40, "car", "in words", "g.png"}}}, folder.path()));
  ASSERT_TRUE(WriteFile(folder.path() / kGatePictures / "g.png", "png"));
  const auto results = ReadGateResults(file);
  ASSERT_TRUE(results.has_value()) << results.error().message;
  EXPECT_EQ((*results)["gates"][0]["verdict"], "fail");
  EXPECT_EQ((*results)["gates"][0]["explanation"]["frame"], 40);
  EXPECT_EQ((*results)["pictures"]["g"], "data:image/png;base64,cG5n");

  const auto spoilt = [&](const std::function<void(nlohmann::json&)>& spoil) -> std::string {
    nlohmann::json json = nlohmann::json::parse(ReadFile(file).value());
    spoil(json);
    const auto other = folder.path() / "spoilt.json";
    EXPECT_TRUE(WriteFile(other, json.dump()));
    const auto read = ReadGateResults(other);
    if (read) return (*read)["pictures"].dump();
    EXPECT_EQ(read.error().kind, ErrorKind::kData);
    return read.error().message.substr(folder.path().string().size() + 1);
  };
  using Json = nlohmann::json;
  EXPECT_EQ(spoilt([](Json& j) { j["schema"] = 7; }), "spoilt.json: schema is 7, expected 1");
  EXPECT_EQ(spoilt([](Json& j) { j.erase("controls"); }),
            "spoilt.json: 'controls' is missing or no list");
  EXPECT_EQ(spoilt([](Json& j) { j["gates"][0]["verdict"] = 3; }),
            "spoilt.json: a gate's 'verdict' is missing or no text");
  EXPECT_EQ(spoilt([](Json& j) { j["gates"][0].erase("bounds"); }),
            "spoilt.json: gate 'g' has no bounds or no mean");
  EXPECT_EQ(
      spoilt([](Json& j) { j["sabotages"][0].erase("caught"); }),
      "spoilt.json: sabotage 'frozen-object' does not say whether it was caught, and by what");
  EXPECT_EQ(spoilt([](Json& j) { j = Json::array(); }), "spoilt.json: not a JSON object");
  // A link among the pictures would put another file's bytes into the page.
  std::filesystem::create_symlink("/etc/hostname", folder.path() / kGatePictures / "far.png");
  EXPECT_NE(spoilt([](Json& j) {
              j["gates"][0]["explanation"]["picture"] = "far.png";
            }).find("leads by a link to '"),
            std::string::npos);
  // No file but those of the folder of pictures.
  EXPECT_EQ(spoilt([](Json& j) { j["gates"][0]["explanation"]["picture"] = "../gates.json"; }),
            "{}");
  EXPECT_EQ(ReadGateResults(folder.path() / "none.json").error().kind, ErrorKind::kData);
}

TEST(GateReportTest, ExitCodeAndColours) {
  EXPECT_EQ(RunOf(Verdict::kPass, "g").exit_code(), 0);
  EXPECT_EQ(RunOf(Verdict::kFail, "g").exit_code(), 1);
  EXPECT_EQ(RunOf(Verdict::kInvalid, "g").exit_code(), 4);
  GateRun run = RunOf(Verdict::kPass, "g");
  run.sabotages.push_back({Sabotage::kFrozenObject, run.gates});
  EXPECT_EQ(run.exit_code(), 1) << "a sabotage that no gate noticed";
  run.sabotages[0].gates[0].judgement.verdict = Verdict::kFail;
  EXPECT_EQ(run.exit_code(), 0);
  EXPECT_EQ(GateTable(run, false).find('\033'), std::string::npos);
  EXPECT_NE(GateTable(run, true).find("\033[32mpass"), std::string::npos);
  run.controls.push_back({{}, Verdict::kFail, 1, "they differ"});
  EXPECT_EQ(run.exit_code(), 4);
}

}  // namespace
}  // namespace tsdfpp
