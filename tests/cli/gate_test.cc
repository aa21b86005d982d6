// `tsdfpp gate` as its users call it, on a few small frames.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>

#include "core/files.h"
#include "tests/cli/run_command.h"
#include "tests/core/temp_folder.h"

namespace tsdfpp {
namespace {

using test::RunTsdfpp;

constexpr const char* kExperiment = R"(name = "tiny"
question = "Does the command work?"
metrics = ["visible_completion"]
replicates = ["seed"]
[frames]
scale = 0.25
stride = 8
[[grid]]
scene = "SCENES/mini.toml"
seed = 1
method = ["tsdf", "tsdf++"]
)";

constexpr const char* kGates = R"([[experiment]]
name = "tiny"
file = "tiny.toml"
profiles = ["quick"]
[[control]]
name = "agree"
experiment = "tiny"
metric = "table_visible_completion"
methods = ["tsdf", "tsdf++"]
spread = 0.5
min = 0.1
why = "the same frames"
[[gate]]
name = "completion"
experiment = "tiny"
metric = "movers_completion"
where = { method = "tsdf++" }
min = 0.1
confidence = 1
why = "it is seen"
[[gate]]
name = "as-before"
experiment = "tiny"
metric = "movers_completion"
where = { method = "tsdf++" }
tolerance = 0.001
confidence = 1
why = "the same program gives the same bytes"
[[sabotage]]
name = "labels-permuted"
caught_by = ["as-before"]
)";

class GateCommand : public ::testing::Test {
 protected:
  void SetUp() override {
    std::string experiment = kExperiment;
    experiment.replace(experiment.find("SCENES"), 6, std::string(TSDFPP_SOURCE_DIR) + "/scenes");
    Write("tiny.toml", experiment);
    Write("gates.toml", kGates);
  }
  void Write(const std::string& name, const std::string& text) const {
    ASSERT_TRUE(WriteFile(folder_.path() / name, text).has_value());
  }
  void Replace(const std::string& old, const std::string& text) const {
    std::string gates = kGates;
    ASSERT_NE(gates.find(old), std::string::npos);
    Write("gates.toml", gates.replace(gates.find(old), old.size(), text));
  }
  test::CommandOutput Gate(std::vector<std::string> options) const {
    options.insert(options.begin(), {"gate", (folder_.path() / "gates.toml").string(), "--out",
                                     (folder_.path() / "out").string()});
    return RunTsdfpp(options, folder_.path());
  }
  std::string File(const std::string& name) const {
    return ReadFile(folder_.path() / name).value_or("");
  }
  test::TempFolder folder_;
};

TEST_F(GateCommand, FromTheFirstReferencesToAFailure) {
  // Without references nothing can be said of the gate that needs them.
  const auto first = Gate({});
  EXPECT_EQ(first.exit_code, 4) << first.out << first.err;
  EXPECT_NE(first.out.find("there is no reference"), std::string::npos) << first.out;

  EXPECT_EQ(Gate({"--update"}).exit_code, 2);
  EXPECT_EQ(File("gates-references.json"), "");
  const auto update = Gate({"--update", "--reason", "the first ones"});
  EXPECT_EQ(update.exit_code, 0) << update.err;
  EXPECT_NE(update.err.find("as-before: new"), std::string::npos) << update.err;
  const auto references = nlohmann::json::parse(File("gates-references.json"));
  EXPECT_EQ(references["gates"]["as-before"]["reason"], "the first ones");

  const auto good = Gate({"--sabotages", "--json"});
  EXPECT_EQ(good.exit_code, 0) << good.out << good.err;
  const auto json = nlohmann::json::parse(good.out);
  EXPECT_EQ(json["controls"][0]["verdict"], "pass");
  EXPECT_EQ(json["gates"][1]["verdict"], "pass");
  EXPECT_EQ(json["gates"][1]["bytes"], "same");
  EXPECT_EQ(json["gates"][1]["mean"], 0.0);
  EXPECT_EQ(json["sabotages"][0]["caught"], true);
  EXPECT_NE(File("out/gates.junit.xml").find("tests=\"4\" failures=\"0\" errors=\"0\""),
            std::string::npos);

  const auto broken = Gate({"--sabotage", "labels-permuted"});
  EXPECT_EQ(broken.exit_code, 1) << broken.out;
  EXPECT_EQ(broken.out.rfind("SABOTAGED: ", 0), 0U) << broken.out;
  EXPECT_NE(File("out/gates.md").find("![picture](pictures/as-before.png)"), std::string::npos)
      << File("out/gates.md");
  EXPECT_GT(File("out/pictures/as-before.png").size(), 1000U);
  EXPECT_EQ(File("gates-references.json"), references.dump(1) + "\n") << "a run changes none";

  const auto explained = Gate({"--explain", "as-before", "--sabotage", "labels-permuted"});
  EXPECT_EQ(explained.exit_code, 0);
  EXPECT_NE(explained.out.find("object car"), std::string::npos) << explained.out;
  EXPECT_NE(explained.out.find("\nvalue: "), std::string::npos) << explained.out;
}

TEST_F(GateCommand, WritesNothingBehindALink) {
  const std::filesystem::path elsewhere = folder_.path() / "elsewhere";
  std::filesystem::create_directories(elsewhere);
  std::filesystem::create_directories(folder_.path() / "out");
  std::filesystem::create_directory_symlink(elsewhere, folder_.path() / "out" / "tiny");
  const auto refused = Gate({});
  EXPECT_EQ(refused.exit_code, test::kUsage) << refused.out << refused.err;
  EXPECT_NE(refused.err.find("tiny: is a link, expected a folder or nothing"), std::string::npos)
      << refused.err;
  EXPECT_TRUE(std::filesystem::is_empty(elsewhere));
}

// An edited cell is no figure of a gate: it is run anew.
TEST_F(GateCommand, AnEditedCellIsRunAgain) {
  const std::string gates = kGates;
  const std::size_t from = gates.find("[[gate]]\nname = \"as-before\"");
  Write("gates.toml", gates.substr(0, from));
  const auto before = Gate({"--json"});
  ASSERT_EQ(before.exit_code, 0) << before.out << before.err;
  const auto edit_all = [&](const std::function<void(nlohmann::json&)>& edit) {
    for (const auto& file :
         std::filesystem::directory_iterator(folder_.path() / "out" / "tiny" / "cells")) {
      nlohmann::json cell = nlohmann::json::parse(ReadFile(file.path()).value());
      edit(cell);
      ASSERT_TRUE(WriteFile(file.path(), cell.dump()));
    }
  };
  const auto mean = [](const test::CommandOutput& output) {
    return nlohmann::json::parse(output.out)["gates"][0]["mean"];
  };
  edit_all([](nlohmann::json& cell) {
    cell["frames"] = nlohmann::json::array();
    cell["examined"]["movers_completion"] = 0.01;
  });
  const auto explained = Gate({"--explain", "completion"});
  EXPECT_EQ(explained.exit_code, 0) << explained.out << explained.err;
  EXPECT_NE(explained.out.find("completion is pass"), std::string::npos) << explained.out;
  edit_all([](nlohmann::json& cell) { cell["examined"]["movers_completion"] = 5.0; });
  const auto after = Gate({"--json"});
  EXPECT_EQ(after.exit_code, 0) << after.out << after.err;
  EXPECT_EQ(mean(after), mean(before));
}

// A gate may look at cells that the experiment breaks itself.
TEST_F(GateCommand, TheAxisSabotageIsAskedFor) {
  std::string experiment = File("tiny.toml");
  const std::string methods = "[\"tsdf\", \"tsdf++\"]";
  experiment.replace(experiment.find(methods), methods.size(),
                     "\"tsdf++\"\nsabotage = [\"none\", \"frozen-object\"]");
  Write("tiny.toml", experiment);
  const std::string head = std::string(kGates).substr(0, std::string(kGates).find("[[control]]"));
  const auto gate = [](const std::string& name, const std::string& choice) {
    return fmt::format(R"([[gate]]
name = "{}"
experiment = "tiny"
metric = "movers_completion"
{}
min = 0.01
confidence = 1
why = "to be seen"
)",
                       name, choice);
  };
  Write("gates.toml", head + gate("healthy", "where = { sabotage = \"none\" }") +
                          gate("frozen", "where = { sabotage = \"frozen-object\" }") +
                          gate("pair",
                               "where = { sabotage = \"none\" }\n"
                               "against = { sabotage = \"frozen-object\" }"));
  const auto ran = Gate({"--json"});
  const auto of = nlohmann::json::parse(ran.out)["gates"];
  const double healthy = of[0]["mean"];
  const double frozen = of[1]["mean"];
  EXPECT_GT(healthy, frozen + 0.01) << ran.out;
  EXPECT_NEAR(of[2]["mean"].get<double>(), healthy - frozen, 1e-12);
}

// An audit takes other seeds, also in place of one that a gate chose among several.
TEST_F(GateCommand, AnAuditTakesItsOwnSeeds) {
  std::string experiment = File("tiny.toml");
  experiment.replace(experiment.find("seed = 1"), 8, "seed = [1, 2]");
  experiment.replace(experiment.find("stride = 8"), 10, "stride = 16");
  Write("tiny.toml", experiment);
  const std::string gates = std::string(kGates).substr(0, std::string(kGates).find("[[control]]")) +
                            R"([[gate]]
name = "one-seed"
experiment = "tiny"
metric = "movers_completion"
where = { method = "tsdf++", seed = 1 }
min = 0.01
confidence = 1
why = "it is seen"
)";
  Write("gates.toml", gates);
  const auto audit = Gate({"--audit", "--json"});
  ASSERT_EQ(audit.exit_code, 0) << audit.out << audit.err;
  const auto json = nlohmann::json::parse(audit.out);
  EXPECT_EQ(json[0]["trials"], 20);
  EXPECT_EQ(json[0]["inconclusive"], 0);
  // Where seeds are no replicates, other seeds are other cells.
  experiment.replace(experiment.find("replicates = [\"seed\"]"), 21, "replicates = [\"scene\"]");
  Write("tiny.toml", experiment);
  const auto refused = Gate({"--audit"});
  EXPECT_EQ(refused.exit_code, 2) << refused.err;
  EXPECT_NE(refused.err.find("gate 'one-seed' cannot be audited on other seeds: expected 'seed' "
                             "among the replicates of experiment 'tiny'"),
            std::string::npos)
      << refused.err;
}

TEST_F(GateCommand, AControlThatFailsMakesAllInvalid) {
  Replace("spread = 0.5\nmin = 0.1", "spread = 0.5\nmin = 0.9999999");
  const auto output = Gate({});
  EXPECT_EQ(output.exit_code, 4) << output.out;
  EXPECT_NE(output.out.find("a control failed"), std::string::npos) << output.out;
  EXPECT_EQ(Gate({"--update", "--reason", "no"}).exit_code, 4);
  EXPECT_EQ(File("gates-references.json"), "");
}

// A cell that was there before its peer is mapped again beside it: times of two runs say nothing.
TEST_F(GateCommand, ComparesTimesOfOneRunOnly) {
  const std::string plain = std::string(kGates).substr(0, std::string(kGates).find("[[control]]"));
  const std::string alone = R"([[gate]]
name = "alone"
experiment = "tiny"
metric = "movers_completion"
where = { method = "tsdf" }
min = 0.1
confidence = 1
why = "it is seen"
)";
  const std::string timed = R"([[gate]]
name = "time"
experiment = "tiny"
metric = "frame_ms"
where = { method = "tsdf++" }
against = { method = "tsdf" }
ratio = true
max = 1000
confidence = 1
why = "not too slow"
)";
  Write("gates.toml", plain + alone);
  EXPECT_EQ(Gate({}).exit_code, 0);
  Write("gates.toml", plain + alone + timed);
  const auto both = Gate({"--json"});
  EXPECT_EQ(both.exit_code, 4) << both.out << both.err;
  const auto json = nlohmann::json::parse(both.out);
  EXPECT_EQ(json["gates"][0]["verdict"], "pass");
  EXPECT_EQ(json["gates"][1]["verdict"], "inconclusive");
  EXPECT_EQ(json["gates"][1]["why"], "5 frames were timed, 20 are needed");
  const auto explained = Gate({"--explain", "time"});
  EXPECT_NE(explained.out.find("time is inconclusive: worst at seed=1; frame "), std::string::npos)
      << explained.out << explained.err;
}

// Two gates have one peer: where one of them was run alone, all three are made again together.
TEST_F(GateCommand, TimesThatShareAPeerAreOfOneRun) {
  std::string experiment = File("tiny.toml");
  const std::string methods = "[\"tsdf\", \"tsdf++\"]";
  experiment.replace(experiment.find(methods), methods.size(),
                     "[\"tsdf\", \"tsdf++\", \"volumes\"]");
  Write("tiny.toml", experiment);
  std::string gates = std::string(kGates).substr(0, std::string(kGates).find("[[control]]"));
  const std::vector<std::pair<std::string, std::string>> timed{{"first", "tsdf++"},
                                                               {"second", "volumes"}};
  for (const auto& [name, method] : timed) {
    gates += fmt::format(R"([[gate]]
name = "{}"
experiment = "tiny"
metric = "frame_ms"
where = {{ method = "{}" }}
against = {{ method = "tsdf" }}
ratio = true
max = 1000
confidence = 1
why = "not too slow"
)",
                         name, method);
  }
  Write("gates.toml", gates);
  Gate({"--explain", "first"});
  for (int i = 0; i < 2; ++i) {
    const auto all = Gate({"--json"});
    const auto json = nlohmann::json::parse(all.out);
    for (const auto& gate : json["gates"]) {
      EXPECT_EQ(gate["why"], "5 frames were timed, 20 are needed") << gate["name"];
    }
  }
}

TEST_F(GateCommand, WrongFilesAndOptionsGetASentence) {
  const std::string folder = folder_.path().string();
  const auto sentence = [&](const test::CommandOutput& output) {
    EXPECT_EQ(output.exit_code, 2) << output.err;
    EXPECT_EQ(output.out, "");
    return output.err;
  };
  Replace("metric = \"movers_completion\"", "metric = \"movers\"");
  EXPECT_EQ(sentence(Gate({})).rfind("tsdfpp: " + folder +
                                         "/gates.toml:16: 'gate.metric' is "
                                         "'movers', expected one of",
                                     0),
            0U);
  Replace("file = \"tiny.toml\"", "file = \"huge.toml\"");
  EXPECT_EQ(sentence(Gate({})), "tsdfpp: " + folder +
                                    "/gates.toml:3: 'experiment.file' is "
                                    "'huge.toml', but there is no file " +
                                    folder + "/huge.toml\n");
  Replace("min = 0.1\nconfidence", "min = 2\nconfidence");
  EXPECT_NE(sentence(Gate({})).find("gates.toml:18: 'gate.min' is 2, but"), std::string::npos);
  Replace("name = \"as-before\"", "name = \"completion\"");
  EXPECT_EQ(sentence(Gate({})), "tsdfpp: " + folder +
                                    "/gates.toml:22: 'gate.name' is "
                                    "'completion', a second time\n");
  Write("gates.toml", kGates);
  EXPECT_NE(sentence(Gate({"--sabotage", "all"})).find("--sabotage is 'all', expected one of none"),
            std::string::npos);
  EXPECT_NE(sentence(Gate({"--explain", "nothing"})).find("--explain 'nothing' is no gate of"),
            std::string::npos);
  EXPECT_NE(sentence(Gate({"--profile", "full"})).find("no gate is in profile 'full'"),
            std::string::npos);
  EXPECT_NE(sentence(Gate({"--reason", "x"})).find("--reason goes with --update alone"),
            std::string::npos);
  EXPECT_FALSE(std::filesystem::exists(folder_.path() / "out"));
}

}  // namespace
}  // namespace tsdfpp
