#include "bench/track.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <map>
#include <optional>
#include <utility>

#include "bench/figure_runs.h"
#include "bench/track_runs.h"
#include "bench/track_scores.h"
#include "bench/track_tables.h"
#include "core/folders.h"
#include "core/toml_reader.h"
#include "metrics/statistics.h"
#include "sim/load_scene.h"
#include "sim/simulated_source.h"

namespace tsdfpp {
namespace {

namespace fs = std::filesystem;

// Objects that move less are not judged: what stands still is easy.
constexpr double kLeastMoved_m = 0.05;
constexpr const char* kNoise = "noise";  // the depth that is drawn

struct RunPlan {
  std::string name;  // as given
  bool is_known = false;
  PoseSource poses = PoseSource::kTrack;
  Method method = Method::kTsdfppAnchored;
  BleedingPixels bleeding = BleedingPixels::kAuto;
};

Expected<RunPlan> PlanOf(const std::string& name) {
  if (name == "known") return RunPlan{name, true};
  const std::size_t space = name.find(' ');
  if (space == std::string::npos) {
    return UsageError(
        "--runs: expected 'known' or a tracker and a method, such as 'track tsdf++', found '{}'",
        name);
  }
  RunPlan plan{name};
  const std::size_t end = name.find(' ', space + 1);
  if (end != std::string::npos) {
    TSDFPP_ASSIGN(plan.bleeding, BleedingPixelsFromName(name.substr(end + 1)));
  }
  TSDFPP_ASSIGN(plan.poses, PoseSourceFromName(name.substr(0, space)));
  TSDFPP_ASSIGN(plan.method, MethodFromName(name.substr(space + 1, end - space - 1)));
  TSDFPP_RETURN_IF_ERROR(CheckPoses(plan.method, plan.poses));
  return plan;
}

struct Plan {
  std::vector<fs::path> scenes;
  std::vector<std::string> depths;
  std::vector<RunPlan> runs;
  SdfTrackConfig settings;
  MapConfig map;
  int until = 0;
  int seeds = 1;
};

Expected<Plan> PlanOf(const TrackBenchOptions& options) {
  Plan plan{{}, options.depths, {}, {}, {}, options.until, options.seeds};
  for (const std::string& name : options.runs) {
    TSDFPP_ASSIGN(RunPlan run, PlanOf(name));
    plan.runs.push_back(std::move(run));
  }
  if (!options.settings.empty()) {
    TSDFPP_ASSIGN(const toml::table table, ParseTomlFile(options.settings));
    TSDFPP_ASSIGN(plan.settings, SdfTrackConfig::FromToml(table, options.settings));
  }
  if (!options.map.empty()) {
    TSDFPP_ASSIGN(const toml::table table, ParseTomlFile(options.map));
    TSDFPP_ASSIGN(plan.map, MapConfig::FromToml(table, options.map));
  }
  TSDFPP_ASSIGN(const std::vector<fs::path> files, ListFolder(options.scenes));
  const auto is_wanted = [&](const fs::path& file) {
    return options.only.empty() || std::ranges::count(options.only, file.stem().string()) > 0;
  };
  for (const fs::path& file : files) {
    if (file.extension() == ".toml" && is_wanted(file)) plan.scenes.push_back(file);
  }
  for (const std::string& name : options.only) {
    const auto is_it = [&](const fs::path& file) { return file.stem() == name; };
    if (std::ranges::none_of(plan.scenes, is_it)) {
      return UsageError("--only: no {}.toml in {}", name, options.scenes);
    }
  }
  return plan;
}

// What one depth is mapped by: the runs, and what is needed to judge them.
struct Stage {
  std::string depth;
  std::uint64_t seed = 0;  // of the noise
  std::vector<std::unique_ptr<TrackRun>> runs{};
  std::map<InstanceId, std::set<int>> shown{};
  std::map<InstanceId, std::vector<double>> shift_shares{};
  std::map<InstanceId, std::vector<double>> turn_shares{};
};

double MedianMs(const TrackRun& run) {
  std::vector<double> ms;
  for (const TrackRun::Cost& cost : run.costs()) ms.push_back(cost.track_ms / cost.objects);
  return ms.empty() ? 0 : MedianOf(ms);
}

Expected<void> Feed(const Frame& frame, const KnownModels& known, const Plan& plan, Stage& stage) {
  for (const auto& run : stage.runs) TSDFPP_RETURN_IF_ERROR(run->Process(frame));
  for (const auto& [id, shares] : KnownShares(frame, known, plan.map.voxel_m, plan.settings)) {
    stage.shown[id].insert(frame.index);
    stage.shift_shares[id].push_back(shares.shift);
    stage.turn_shares[id].push_back(shares.turn);
  }
  return {};
}

std::vector<TrackRow> Judge(const std::string& scene, const Plan& plan, const Stage& stage,
                            const std::vector<TrueModel>& models,
                            const std::map<InstanceId, Trajectory>& truth) {
  std::vector<TrackRow> rows;
  for (std::size_t i = 0; i < plan.runs.size(); ++i) {
    const TrackRun& run = *stage.runs[i];
    for (const TrueModel& model : models) {
      const InstanceId id = model.info.id;
      const auto estimate = run.trajectories().find(id);
      if (!stage.shown.contains(id) || estimate == run.trajectories().end()) continue;
      TrackedObject object{estimate->second, truth.at(id), stage.shown.at(id),
                           SomePoints(model.mesh_O)};
      const auto motions = run.log().motions().find(id);
      if (motions != run.log().motions().end()) object.motions = motions->second;
      TrackRow row{scene,           stage.depth,         stage.seed, plan.runs[i].name,
                   model.info.name, ScoreTracked(object)};
      if (row.scores.moved_m < kLeastMoved_m) continue;
      row.span = run.log().objects().at(id);
      row.shown = stage.shown.at(id).size();
      row.shift_share = MedianOf(stage.shift_shares.at(id));
      row.turn_share = MedianOf(stage.turn_shares.at(id));
      row.ms = MedianMs(run);
      rows.push_back(std::move(row));
    }
  }
  return rows;
}

Expected<std::vector<TrackRow>> RunScene(const fs::path& file, const Plan& plan) {
  TSDFPP_ASSIGN(const SceneConfig scene, LoadSceneConfig(file));
  TSDFPP_ASSIGN(const auto source, SimulatedSource::Open(scene, {}));
  TSDFPP_ASSIGN(const SensorConfig noisy, SensorPresetNamed("nguyen2012"));
  TSDFPP_ASSIGN(const std::vector<TrueModel> models, source->Truth());
  const SequenceInfo& info = source->info();
  const double voxel_m = plan.map.voxel_m;
  const KnownModels known = KnownModelsOf(models, voxel_m);
  std::vector<Stage> stages;
  const auto add_stage = [&](const std::string& depth, std::uint64_t seed) {
    Stage& stage = stages.emplace_back(Stage{depth, seed});
    for (const RunPlan& run : plan.runs) {
      stage.runs.push_back(run.is_known ? MakeKnownRun(known, voxel_m, plan.settings)
                                        : MakeMapRun(info.objects, {.method = run.method,
                                                                    .map = plan.map,
                                                                    .bleeding = run.bleeding,
                                                                    .poses = run.poses,
                                                                    .tracked = TrackChoice::kAll,
                                                                    .track = plan.settings}));
    }
  };
  for (const std::string& depth : plan.depths) {
    const int draws = depth == kNoise ? plan.seeds : 1;
    for (int i = 0; i < draws; ++i) add_stage(depth, scene.seed + static_cast<std::uint64_t>(i));
  }
  std::map<InstanceId, Trajectory> truth;
  const int last = std::min(plan.until, info.first_index + info.frame_count - 1);
  for (int index = info.first_index; index <= last; ++index) {
    TSDFPP_ASSIGN(const Frame frame, source->ReadTrue(index));
    for (const auto& [id, T_WO] : frame.T_WO) truth[id][index] = T_WO;
    for (Stage& stage : stages) {
      Frame sensed = frame;
      if (stage.depth == kNoise) {
        TSDFPP_ASSIGN(const SensedTruth ignored, ApplySensor(noisy, stage.seed, info, sensed));
      }
      TSDFPP_RETURN_IF_ERROR(Feed(sensed, known, plan, stage));
    }
  }
  std::vector<TrackRow> rows;
  for (const Stage& stage : stages) {
    for (TrackRow& row : Judge(info.name, plan, stage, models, truth))
      rows.push_back(std::move(row));
  }
  return rows;
}

std::string Said(const Measured& value, double factor) {
  return value.value ? Cell(*value.value * factor, 2) : "-";
}

}  // namespace

Expected<void> RunTrackBench(const TrackBenchOptions& options) {
  TSDFPP_ASSIGN(const Plan plan, PlanOf(options));
  std::vector<TrackRow> rows;
  for (const fs::path& file : plan.scenes) {
    TSDFPP_ASSIGN(const std::vector<TrackRow> of_scene, RunScene(file, plan));
    for (const TrackRow& row : of_scene) {
      std::printf("%s, %s, seed %s, %s, %s: ATE %s mm, %s deg\n", row.scene.c_str(),
                  row.depth.c_str(), std::to_string(row.seed).c_str(), row.run.c_str(),
                  row.object.c_str(), Said(row.scores.trajectory.ate_rmse_m, 1e3).c_str(),
                  Said(row.scores.trajectory.rotation_rmse_deg, 1).c_str());
      rows.push_back(row);
    }
    std::fflush(stdout);
  }
  TrackTables tables{plan.depths, {}};
  for (const RunPlan& run : plan.runs) tables.runs.push_back(run.name);
  return WriteTrackTables(rows, tables, options.out);
}

}  // namespace tsdfpp
