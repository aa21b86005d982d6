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
// Turns are judged where the terms on the true surface know of each at least this share, which a
// ball's do not.
constexpr double kFixedTurn = 0.01;
// Between these the squared errors of motions are called as large as the covariance says.
constexpr double kLeastNees = 0.5;
constexpr double kMostNees = 2;
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
  int until = 0;
  int seeds = 1;
};

Expected<Plan> PlanOf(const TrackBenchOptions& options) {
  Plan plan{{}, options.depths, {}, {}, options.until, options.seeds};
  for (const std::string& name : options.runs) {
    TSDFPP_ASSIGN(RunPlan run, PlanOf(name));
    plan.runs.push_back(std::move(run));
  }
  if (!options.settings.empty()) {
    TSDFPP_ASSIGN(const toml::table table, ParseTomlFile(options.settings));
    TSDFPP_ASSIGN(plan.settings, SdfTrackConfig::FromToml(table, options.settings));
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

struct Row {
  std::string scene;
  std::string depth;
  std::uint64_t seed = 0;
  std::string run;
  std::string object;
  TrackScores scores{};
  TrackSpan span{};
  std::size_t shown = 0;
  double shift_share = 0;
  double turn_share = 0;
  double ms = 0;  // an object and frame, the median of the run
};

double MedianMs(const TrackRun& run) {
  std::vector<double> ms;
  for (const TrackRun::Cost& cost : run.costs()) ms.push_back(cost.track_ms / cost.objects);
  return ms.empty() ? 0 : MedianOf(ms);
}

Expected<void> Feed(const Frame& frame, const KnownModels& known, const Plan& plan, Stage& stage) {
  for (const auto& run : stage.runs) TSDFPP_RETURN_IF_ERROR(run->Process(frame));
  for (const auto& [id, shares] : KnownShares(frame, known, MapConfig{}.voxel_m, plan.settings)) {
    stage.shown[id].insert(frame.index);
    stage.shift_shares[id].push_back(shares.shift);
    stage.turn_shares[id].push_back(shares.turn);
  }
  return {};
}

std::vector<Row> Judge(const std::string& scene, const Plan& plan, const Stage& stage,
                       const std::vector<TrueModel>& models,
                       const std::map<InstanceId, Trajectory>& truth) {
  std::vector<Row> rows;
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
      Row row{scene,           stage.depth,         stage.seed, plan.runs[i].name,
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

Expected<std::vector<Row>> RunScene(const fs::path& file, const Plan& plan) {
  TSDFPP_ASSIGN(const SceneConfig scene, LoadSceneConfig(file));
  TSDFPP_ASSIGN(const auto source, SimulatedSource::Open(scene, {}));
  TSDFPP_ASSIGN(const SensorConfig noisy, SensorPresetNamed("nguyen2012"));
  TSDFPP_ASSIGN(const std::vector<TrueModel> models, source->Truth());
  const SequenceInfo& info = source->info();
  const double voxel_m = MapConfig{}.voxel_m;
  const KnownModels known = KnownModelsOf(models, voxel_m);
  std::vector<Stage> stages;
  const auto add_stage = [&](const std::string& depth, std::uint64_t seed) {
    Stage& stage = stages.emplace_back(Stage{depth, seed});
    for (const RunPlan& run : plan.runs) {
      stage.runs.push_back(run.is_known ? MakeKnownRun(known, voxel_m, plan.settings)
                                        : MakeMapRun(info.objects, {.method = run.method,
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
  std::vector<Row> rows;
  for (const Stage& stage : stages) {
    for (Row& row : Judge(info.name, plan, stage, models, truth)) rows.push_back(std::move(row));
  }
  return rows;
}

std::string Scaled(const Measured& value, double factor, int digits) {
  return value.value ? Cell(*value.value * factor, digits) : std::string();
}

Expected<void> WriteObjects(const std::vector<Row>& rows, const fs::path& out) {
  FigureTable table({"scene",
                     "depth",
                     "seed",
                     "run",
                     "object",
                     "moved cm",
                     "ATE mm",
                     "farthest mm",
                     "end mm",
                     "rotation deg",
                     "Co-Fusion ATE mm",
                     "RPE mm",
                     "RPE deg",
                     "ADD mm",
                     "ADD-S mm",
                     "within 5 mm",
                     "within 2 cm",
                     "shown",
                     "tracked",
                     "stayed",
                     "frozen",
                     "known of shifts",
                     "known of turns",
                     "NEES",
                     "free directions"});
  for (const Row& row : rows) {
    const TrackScores& s = row.scores;
    table.Add({row.scene,
               row.depth,
               std::to_string(row.seed),
               row.run,
               row.object,
               Cell(100 * s.moved_m, 1),
               Scaled(s.trajectory.ate_rmse_m, 1e3, 2),
               Cell(1e3 * s.farthest_m, 2),
               Cell(1e3 * s.end_m, 2),
               Scaled(s.trajectory.rotation_rmse_deg, 1, 2),
               Scaled(s.trajectory.cofusion_rmse_m, 1e3, 2),
               Scaled(s.trajectory.rpe_rmse_m, 1e3, 2),
               Scaled(s.trajectory.rpe_rmse_deg, 1, 2),
               Scaled(s.add_m, 1e3, 2),
               Scaled(s.add_s_m, 1e3, 2),
               Scaled(s.within_5mm, 1, 3),
               Scaled(s.within_2cm, 1, 3),
               std::to_string(row.shown),
               std::to_string(row.span.tracked),
               std::to_string(row.span.stayed),
               std::to_string(row.span.frozen),
               Cell(row.shift_share, 4),
               Cell(row.turn_share, 4),
               Scaled(s.nees, 1, 2),
               Cell(s.free_directions, 2)});
  }
  return table.Write(out, "objects");
}

// The median over the seeds of the medians over their objects, with the least and the largest of
// these where they are several; and the worst of all objects.
struct SeedCells {
  std::size_t objects = 0;  // of one seed, the most
  std::string median;
  std::string worst;
};
SeedCells CellsOf(const std::map<std::uint64_t, std::vector<double>>& by_seed, int digits) {
  SeedCells cells;
  std::vector<double> medians;
  double worst = 0;
  for (const auto& [seed, values] : by_seed) {
    cells.objects = std::max(cells.objects, values.size());
    medians.push_back(MedianOf(values));
    worst = std::max(worst, *std::ranges::max_element(values));
  }
  if (medians.empty()) return cells;
  cells.median = Cell(MedianOf(medians), digits);
  cells.worst = Cell(worst, digits);
  if (medians.size() > 1) {
    cells.median += fmt::format(" [{} to {}]", Cell(*std::ranges::min_element(medians), digits),
                                Cell(*std::ranges::max_element(medians), digits));
  }
  return cells;
}

// A row a scene and depth: of each run the median and the largest over the objects.
template <typename ValueOf>
Expected<void> WriteByScene(const std::vector<Row>& rows, const Plan& plan, const fs::path& out,
                            const std::string& name, int digits, const ValueOf& value_of) {
  std::vector<std::string> columns{"scene", "depth", "objects"};
  for (const RunPlan& run : plan.runs) {
    columns.push_back(run.name + ": median");
    columns.push_back(run.name + ": worst");
  }
  FigureTable table(std::move(columns));
  std::vector<std::pair<std::string, std::string>> keys;  // in order
  for (const Row& row : rows) {
    const std::pair key{row.scene, row.depth};
    if (std::ranges::count(keys, key) == 0) keys.push_back(key);
  }
  for (const auto& [scene, depth] : keys) {
    std::vector<std::string> cells{scene, depth, ""};
    for (const RunPlan& run : plan.runs) {
      std::map<std::uint64_t, std::vector<double>> by_seed;
      for (const Row& row : rows) {
        if (row.scene != scene || row.depth != depth || row.run != run.name) continue;
        if (const std::optional<double> value = value_of(row)) by_seed[row.seed].push_back(*value);
      }
      SeedCells of_run = CellsOf(by_seed, digits);
      cells[2] = std::to_string(of_run.objects);
      cells.push_back(std::move(of_run.median));
      cells.push_back(std::move(of_run.worst));
    }
    table.Add(std::move(cells));
  }
  return table.Write(out, name);
}

Expected<void> WriteTimes(const std::vector<Row>& rows, const fs::path& out) {
  FigureTable table({"scene", "depth", "seed", "run", "ms an object and frame"});
  const Row* before = nullptr;  // rows of a run follow each other
  for (const Row& row : rows) {
    const bool is_same = before != nullptr && before->scene == row.scene &&
                         before->depth == row.depth && before->seed == row.seed &&
                         before->run == row.run;
    if (!is_same) {
      table.Add({row.scene, row.depth, std::to_string(row.seed), row.run, Cell(row.ms, 2)});
    }
    before = &row;
  }
  return table.Write(out, "times");
}

// A row a depth and run, over the scenes and objects.
Expected<void> WriteUncertainty(const std::vector<Row>& rows, const Plan& plan,
                                const fs::path& out) {
  FigureTable table({"depth", "run", "objects", "0.5 to 2", "least", "median", "largest"});
  for (const std::string& depth : plan.depths) {
    for (const RunPlan& run : plan.runs) {
      std::vector<double> values;
      for (const Row& row : rows) {
        if (row.depth != depth || row.run != run.name || !row.scores.nees.value) continue;
        values.push_back(*row.scores.nees.value);
      }
      if (values.empty()) continue;
      const auto honest = std::ranges::count_if(
          values, [](double value) { return value >= kLeastNees && value <= kMostNees; });
      table.Add({depth, run.name, std::to_string(values.size()), std::to_string(honest),
                 Cell(*std::ranges::min_element(values), 2), Cell(MedianOf(values), 2),
                 Cell(*std::ranges::max_element(values), 2)});
    }
  }
  return table.Write(out, "uncertainty");
}

Expected<void> WriteTables(const std::vector<Row>& rows, const Plan& plan, const fs::path& out) {
  TSDFPP_RETURN_IF_ERROR(WriteObjects(rows, out));
  TSDFPP_RETURN_IF_ERROR(WriteByScene(rows, plan, out, "shifts", 2, [](const Row& row) {
    const auto& ate_m = row.scores.trajectory.ate_rmse_m.value;
    return ate_m ? std::optional(1e3 * *ate_m) : std::nullopt;
  }));
  TSDFPP_RETURN_IF_ERROR(WriteByScene(rows, plan, out, "turns", 2, [](const Row& row) {
    return row.turn_share < kFixedTurn ? std::nullopt
                                       : row.scores.trajectory.rotation_rmse_deg.value;
  }));
  TSDFPP_RETURN_IF_ERROR(WriteUncertainty(rows, plan, out));
  return WriteTimes(rows, out);
}

}  // namespace

Expected<void> RunTrackBench(const TrackBenchOptions& options) {
  TSDFPP_ASSIGN(const Plan plan, PlanOf(options));
  std::vector<Row> rows;
  for (const fs::path& file : plan.scenes) {
    TSDFPP_ASSIGN(const std::vector<Row> of_scene, RunScene(file, plan));
    for (const Row& row : of_scene) {
      std::printf("%s, %s, seed %s, %s, %s: ATE %s mm, %s deg\n", row.scene.c_str(),
                  row.depth.c_str(), std::to_string(row.seed).c_str(), row.run.c_str(),
                  row.object.c_str(), Scaled(row.scores.trajectory.ate_rmse_m, 1e3, 2).c_str(),
                  Scaled(row.scores.trajectory.rotation_rmse_deg, 1, 2).c_str());
      rows.push_back(row);
    }
    std::fflush(stdout);
  }
  return WriteTables(rows, plan, options.out);
}

}  // namespace tsdfpp
