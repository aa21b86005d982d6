#include "eval/sweep/bench_set.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "core/files.h"
#include "core/folders.h"
#include "core/one_line.h"
#include "eval/sweep/sweep_metrics.h"
#include "mapper/method_info.h"
#include "sequence/sequence_json.h"
#include "sim/load_scene.h"
#include "sim/motion/scene_motion.h"
#include "sim/scene/scene_builder.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;

std::string Rounded(const Eigen::Vector3d& p) {
  constexpr double kUnits_per_m = 1e5;
  return fmt::format("{} {} {}\n", std::llround(p.x() * kUnits_per_m),
                     std::llround(p.y() * kUnits_per_m), std::llround(p.z() * kUnits_per_m));
}

// Where a pose takes the origin and the ends of the axes, each 10 cm long.
std::string Rounded(const Pose& T) {
  constexpr double kArm_m = 0.1;
  std::string text = Rounded(Eigen::Vector3d(T.translation()));
  for (int axis = 0; axis < 3; ++axis) {
    text += Rounded(Eigen::Vector3d(T.translation() + kArm_m * T.linear().col(axis)));
  }
  return text;
}

// `taken` are the names of those before it.
Expected<BenchSequence> ReadSequence(const toml::table& table, const std::string& where,
                                     std::set<std::string>& taken) {
  BenchSequence sequence;
  TomlReader reader(table, where, "sequence");
  reader.Get("name", sequence.name, true)
      .Get("scene", sequence.scene, true)
      .Get("scene_hash", sequence.scene_hash, true)
      .Get("truth_hash", sequence.truth_hash, true);
  if (!taken.insert(sequence.name).second) {
    reader.Fault("name", fmt::format("is {}, a second time", Quoted(sequence.name)));
  }
  TSDFPP_RETURN_IF_ERROR(reader.Finish());
  return sequence;
}

// What experiments may ask for, a set may have.
void CheckValues(TomlReader& reader, const BenchSet& set) {
  if (!(set.scale >= 0.05 && set.scale <= 4)) {
    reader.Fault("scale", fmt::format("is {}, expected a number from 0.05 to 4", set.scale));
  }
  for (const auto& [axis, value] :
       {std::pair{"voxel_m", set.voxel_m}, std::pair{"trunc_front", set.trunc_front},
        std::pair{"trunc_back", set.trunc_back}}) {
    CellSettings probe;
    if (auto fits = FindAxis(axis)->set(probe, value); !fits) {
      reader.Fault(axis, fits.error().message);
    }
  }
}

// The scene's own, with which it was frozen. Errors: those of LoadSceneConfig; kUsage where an
// experiment has no such seed.
Expected<AxisValue> SeedOf(const BenchSet& set, const BenchSequence& sequence) {
  const fs::path file = set.file.parent_path() / sequence.scene;
  TSDFPP_ASSIGN(const SceneConfig scene, LoadSceneConfig(file));
  if (scene.seed > kLargestSeed) {
    return UsageError("{}: 'seed' is {}, expected 0 to {} in a scene of a benchmark", file.string(),
                      scene.seed, kLargestSeed);
  }
  return AxisValue(static_cast<double>(scene.seed));
}

}  // namespace

Expected<BenchSet> BenchSet::Load(const fs::path& folder, const std::string& name) {
  BenchSet set;
  set.file = folder / name / "set.toml";
  std::error_code code;
  if (!fs::exists(set.file, code)) {
    std::string known;
    for (const fs::path& entry : EntriesOf(folder)) {
      if (!IsThere(entry / "set.toml")) continue;
      known += (known.empty() ? "" : ", ") + entry.filename().string();
    }
    return UsageError("there is no benchmark '{}' in {}, expected one of: {}", name,
                      folder.string(), known.empty() ? "none is there" : known);
  }
  TSDFPP_ASSIGN(const std::string text, ReadFile(set.file));
  set.hash = HashText(text);
  const std::string where = set.file.string();
  TSDFPP_ASSIGN(const toml::table root, ParseToml(text, where));
  TomlReader reader(root, where);
  reader.Get("name", set.name, true)
      .Get("scale", set.scale, true)
      .Get("voxel_m", set.voxel_m, true)
      .Get("trunc_front", set.trunc_front, true)
      .Get("trunc_back", set.trunc_back, true)
      .Get("metrics", set.metrics, true);
  // The results are of this name, and are looked for by it.
  if (const std::string folder_name = OwnName(folder / name); set.name != folder_name) {
    reader.Fault("name", fmt::format("is {}, expected '{}', as the folder is called",
                                     Quoted(set.name), folder_name));
  }
  std::set<std::string> metrics;
  for (const std::string& metric : set.metrics) {
    if (FindMetric(metric) == nullptr) {
      reader.Fault("metrics", fmt::format("holds '{}', which is no metric", metric));
    }
    if (!metrics.insert(metric).second) {
      reader.Fault("metrics", fmt::format("holds '{}' twice", metric));
    }
  }
  CheckValues(reader, set);
  if (set.metrics.empty()) reader.Fault("metrics", "is empty, expected one name at least");
  std::set<std::string> taken;
  for (const toml::table* table : reader.Tables("sequence", true)) {
    TSDFPP_ASSIGN(BenchSequence sequence, ReadSequence(*table, where, taken));
    set.sequences.push_back(std::move(sequence));
  }
  TSDFPP_RETURN_IF_ERROR(reader.Finish());
  return set;
}

Expected<BenchSequence> HashSequence(const BenchSet& set, const BenchSequence& sequence) {
  TSDFPP_ASSIGN(const SceneConfig scene, LoadSceneConfig(set.file.parent_path() / sequence.scene));
  TSDFPP_ASSIGN(CompiledScene compiled, CompiledScene::Compile(scene));
  TSDFPP_ASSIGN(const SceneMotion motion, SceneMotion::Make(scene));
  std::string truth;
  for (const TrueModel& model : compiled.TrueModels()) {
    truth += fmt::format("{} {}\n", model.info.id, model.info.name);
    for (const Eigen::Vector3f& vertex : model.mesh_O.vertices) {
      truth += Rounded(Eigen::Vector3d(vertex.cast<double>()));
    }
  }
  for (int frame = kFirstFrame; frame < kFirstFrame + scene.frames; ++frame) {
    truth += Rounded(motion.T_WC(frame));
    for (const auto& [id, T_WO] : motion.T_WO(frame)) {
      truth += fmt::format("{} {}", id, Rounded(T_WO));
    }
  }
  return BenchSequence{sequence.name, sequence.scene, HashText(SceneToToml(scene)),
                       HashText(truth)};
}

Expected<void> CheckFrozen(const BenchSet& set) {
  for (const BenchSequence& sequence : set.sequences) {
    TSDFPP_ASSIGN(const BenchSequence now, HashSequence(set, sequence));
    if (now.scene_hash != sequence.scene_hash) {
      return DataError("benchmark {}: scene of sequence {} has hash {}, frozen is {}", set.name,
                       sequence.name, now.scene_hash, sequence.scene_hash);
    }
    if (now.truth_hash != sequence.truth_hash) {
      return DataError(
          "benchmark {}: surfaces and motion of sequence {} have hash {}, frozen is {}", set.name,
          sequence.name, now.truth_hash, sequence.truth_hash);
    }
  }
  return {};
}

Expected<ExperimentConfig> ExperimentOf(const BenchSet& set,
                                        const std::vector<std::string>& methods) {
  ExperimentConfig config;
  config.file = set.file;
  config.name = "bench-set-" + set.name;
  config.question = "What does the benchmark say?";
  config.metrics = set.metrics;
  config.frames.scale = set.scale;
  std::vector<AxisValue> names;
  for (const std::string& method : methods) {
    // Ours alone. The axis also takes Open3D's, which has a band of its own in place of the set's,
    // and no labels, without which any surface counts as the table.
    TSDFPP_ASSIGN(const Method known, MethodFromName(method));
    const AxisValue name = std::string(MethodName(known));
    if (std::find(names.begin(), names.end(), name) != names.end()) {
      return UsageError("method {} is named twice", AxisText(name));
    }
    names.push_back(name);
  }
  if (names.empty()) return UsageError("no method is named, expected one at least");
  config.baseline = std::get<std::string>(names.front());
  for (const BenchSequence& sequence : set.sequences) {
    TSDFPP_ASSIGN(const AxisValue seed, SeedOf(set, sequence));
    config.grids.push_back({sequence.name,
                            {{"scene", {sequence.scene}},
                             {"seed", {seed}},
                             {"method", names},
                             {"voxel_m", {set.voxel_m}},
                             {"trunc_front", {set.trunc_front}},
                             {"trunc_back", {set.trunc_back}}}});
  }
  return config;
}

}  // namespace tsdfpp
