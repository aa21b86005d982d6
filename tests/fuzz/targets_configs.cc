// What users write in TOML: scenes, experiments, gates, adapters, benchmark sets.
#include <algorithm>

#include "core/files.h"
#include "core/toml_reader.h"
#include "eval/adapters/adapter.h"
#include "eval/gate/gate_config.h"
#include "eval/gate/gate_reference.h"
#include "eval/sweep/bench_result.h"
#include "sim/config/scene_config.h"
#include "sim/motion/random_scene.h"
#include "sim/scene/scene_inputs.h"
#include "tests/fuzz/complaint.h"
#include "tests/fuzz/file_set.h"
#include "tests/fuzz/target.h"

namespace tsdfpp::fuzz {
namespace {

namespace fs = std::filesystem;

// With the files that it names: recorded paths, meshes, pictures. A scene that is drawn at random
// is read only: drawing it takes a simulator and is no reader.
bool ReadScene(std::string_view input) {
  const fs::path& folder = WriteSet(input);
  const fs::path path = folder / "scene.toml";
  const auto root = ParseTomlFile(path);
  if (!Accepted(root, path.string())) return false;
  if (IsRandomScene(*root)) return Accepted(ReadRandomScene(*root, path.string()), path.string());
  const auto text = ReadFile(path);
  Require(text.has_value(), "a file that was read cannot be read");
  const auto scene = ParseSceneConfig(*text, path.string(), folder);
  if (!Accepted(scene)) return false;
  const std::string written = SceneToToml(*scene);
  const auto again = ParseSceneConfig(written, path.string());
  Require(again.has_value(), again ? "" : "what was written is refused: " + again.error().message);
  Require(SceneToToml(*again) == written, "what was written is read as something else");
  (void)Accepted(CollectInputs(*scene));
  return true;
}

bool ReadExperiment(std::string_view input) {
  const fs::path path = WriteOne("experiment.toml", input);
  const auto experiment = ExperimentConfig::Load(path);
  if (!Accepted(experiment, path.string())) return false;
  const std::vector<PlannedCell> cells = CellsOf(*experiment);
  Require(!cells.empty(), "an experiment without cells");
  constexpr std::size_t kLookedAt = 50;
  for (std::size_t i = 0; i < std::min(cells.size(), kLookedAt); ++i) {
    const auto read = SettingsFromJson(SettingsJson(cells[i].settings));
    Require(read.has_value(), read ? "" : "what was written is refused: " + read.error().message);
    if (Accepted(cells[i].settings.Pipeline())) {
      Require(MapKey(*read) == MapKey(cells[i].settings), "settings that are read as others");
    }
  }
  return true;
}

// With experiments and references beside it.
bool ReadGates(std::string_view input) {
  const fs::path path = WriteSet(input) / "gates.toml";
  const auto gates = GatesConfig::Load(path);
  const auto references = LoadReferences(path.parent_path() / "gates-references.json");
  (void)Accepted(references, "gates-references.json");
  if (references) (void)ReferencesDifference({}, *references);
  return Accepted(gates);
}

bool ReadAdapterInput(std::string_view input) {
  const fs::path path = WriteOne("adapter.toml", input);
  const auto adapter = ReadAdapter(path);
  if (!Accepted(adapter, path.string())) return false;
  const std::string written = adapter->ToToml();
  const auto again = ReadAdapter(WriteOne("adapter.toml", written));
  Require(again.has_value(), again ? "" : "what was written is refused: " + again.error().message);
  Require(again->ToToml() == written, "what was written is read as something else");
  (void)Accepted(CommandOf(*adapter, AdapterTask{}, "out"));
  return true;
}

// A set with the results that a leaderboard reads.
bool ReadBenchSet(std::string_view input) {
  const fs::path& folder = WriteSet(input);
  auto set = BenchSet::Load(folder, "v1");
  if (!Accepted(set)) return false;
  set->hash = "0123456789abcdef";  // that of the results, whatever becomes of the set's text
  return Accepted(Leaderboard(*set, folder / "results"));
}

}  // namespace

void AddConfigTargets(std::vector<Target>& targets) {
  targets.push_back(
      {"scene",
       "",
       ReadScene,
       {"sim/config/scene_config.cc", "sim/config/scene_object_config.cc",
        "sim/config/scene_readers.cc", "sim/config/camera_config.cc", "sim/config/sensor_config.cc",
        "sim/config/light_rig.cc", "sim/config/random_scene_config.cc", "sim/scene/scene_inputs.cc",
        "sim/config/scene_toml.cc"}});
  targets.push_back({"experiment",
                     "experiment.toml",
                     ReadExperiment,
                     {"eval/sweep/experiment.cc", "eval/sweep/sweep_settings.cc"}});
  targets.push_back(
      {"gates", "", ReadGates, {"eval/gate/gate_config.cc", "eval/gate/gate_reference.cc"}});
  targets.push_back({"adapter", "adapter.toml", ReadAdapterInput, {"eval/adapters/adapter.cc"}});
  targets.push_back(
      {"bench_set", "", ReadBenchSet, {"eval/sweep/bench_result.cc", "eval/sweep/bench_set.cc"}});
}

}  // namespace tsdfpp::fuzz
