#include "bench/released.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <mutex>
#include <thread>

#include "bench/figure_runs.h"
#include "core/files.h"
#include "eval/score/evaluation_columns.h"
#include "tests/reference/float_map.h"

namespace tsdfpp {
namespace {

using reference::FieldMoves;
using reference::FloatConfig;
using reference::FloatMap;
using reference::FloatVoxel;
using reference::Weighting;

struct SmallScene {
  const char* name;
  double scale;  // of the images
  int step;      // frames
  int reveal;
  std::set<InstanceId> movers;

  std::string Path() const { return fmt::format("scenes/{}.toml", name); }
};
const std::vector<SmallScene>& SmallScenes() {
  static const std::vector<SmallScene> scenes{{"mini", 1, 1, 40, {1}},
                                              {"toycar3", 0.35, 4, 256, {1, 2}}};
  return scenes;
}

struct FloatMethod {
  const char* name;
  std::unique_ptr<FloatMap> (*make)(const FloatConfig&);
};
constexpr std::array<FloatMethod, 3> kFloatMethods{
    {{"tsdf", [](const FloatConfig& c) { return reference::MakeFloatTsdf(c, FieldMoves::kAll); }},
     {"tsdf/static",
      [](const FloatConfig& c) { return reference::MakeFloatTsdf(c, FieldMoves::kNone); }},
     {"tsdf++", reference::MakeFloatTsdfpp}}};

struct Setting {
  std::string name;
  FloatConfig config;
};

constexpr float kOurCap = 50;
constexpr float kReleasedCap = 10000;
constexpr Weighting kOurWeighting{false, false, false, kOurCap};
constexpr Weighting kReleasedWeighting{true, true, false, kReleasedCap};
constexpr const char* kOursName = "10/10; ours";
constexpr const char* kReleasedName = "released";
constexpr const char* kRaysName = "released; weights summed over rays";

FloatConfig Banded(double front_voxels, double back_voxels, const Weighting& weighting) {
  FloatConfig config;
  config.front_voxels = front_voxels;
  config.back_voxels = back_voxels;
  config.weighting = weighting;
  return config;
}

// Each band with our weights, with each part of the released ones alone and with all of them; then
// the released configuration with what else voxblox does, and stored as production stores.
std::vector<Setting> Settings() {
  std::vector<Setting> settings;
  for (const auto& [front, back] : {std::pair{10, 10}, {10, 3}, {3, 3}}) {
    const auto add = [&, front = front, back = back](const std::string& what, Weighting weighting) {
      const bool is_released = front == 3 && what == "all three";
      settings.push_back({is_released ? kReleasedName : fmt::format("{}/{}; {}", front, back, what),
                          Banded(front, back, weighting)});
    };
    add("ours", kOurWeighting);
    add("1/z^2", {true, false, false, kOurCap});
    add("drop-off", {false, true, false, kOurCap});
    add("cap 10000", {false, false, false, kReleasedCap});
    add("all three", kReleasedWeighting);
  }
  const auto add = [&](const char* name, const auto& change) {
    FloatConfig config = Banded(3, 3, kReleasedWeighting);
    change(config);
    settings.push_back({name, config});
  };
  add(kRaysName, [](FloatConfig& c) { c.weighting.rays = true; });
  add("released; the mean is clamped", [](FloatConfig& c) { c.clamp_mean = true; });
  add("released; both", [](FloatConfig& c) { c.weighting.rays = c.clamp_mean = true; });
  add("released; distances in half precision", [](FloatConfig& c) { c.half_distances = true; });
  add("released; weights in bytes", [](FloatConfig& c) { c.byte_weights = true; });
  return settings;
}

std::unique_ptr<FloatMap> MapFloats(const Footage& footage, int reveal, const FloatMethod& method,
                                    const FloatConfig& config) {
  auto map = method.make(config);
  for (const Frame& frame : footage.frames) {
    if (frame.index > reveal) break;
    for (const auto& [id, T_WO] : frame.T_WO) map->SetObjectPose(id, T_WO);
    map->Fuse(frame, frame.mask);
  }
  return map;
}

// As MeshesOf does it for a MapRepresentation.
SceneMeshes MeshesOfFloats(const FloatMap& map, const std::set<InstanceId>& movers) {
  SceneMeshes meshes;
  meshes.scene = map.SceneMesh();
  for (const std::set<InstanceId>& removed : RemovalsOf(movers)) {
    if (removed.empty()) continue;
    const auto copy = map.Clone();
    for (const InstanceId id : removed) copy->Remove(id);
    meshes.without[removed] = copy->SceneMesh();
  }
  return meshes;
}

struct Score {
  const char* title;
  const char* column;  // of EvaluationColumns()
};
constexpr std::array<Score, 4> kScores{{{"kept", "table_preservation_behind_other"},
                                        {"movers", "movers_completion"},
                                        {"worst", "sanity_least"},
                                        {"ghosts", "ghost_area_cm2"}}};
using ScoreCells = std::array<std::string, kScores.size()>;

ScoreCells CellsOf(const Evaluation& evaluation, const std::set<InstanceId>& movers) {
  ScoreCells cells;
  for (std::size_t i = 0; i < kScores.size(); ++i) {
    for (const EvaluationColumn& column : EvaluationColumns()) {
      if (column.csv != kScores[i].column) continue;
      const Measured measured = column.value(movers, evaluation);
      if (measured.value) cells[i] = Cell(*measured.value, column.decimals);
    }
  }
  return cells;
}

// What the voxels of a map weigh, and what a byte makes of it.
std::vector<std::string> WeightCells(const FloatMap& map) {
  std::vector<float> weights;
  map.ForEachObserved([&](const FloatVoxel& voxel) { weights.push_back(voxel.weight); });
  std::sort(weights.begin(), weights.end());
  if (weights.empty()) return {"", "", "", "", ""};
  const auto below = [&](float limit) {
    const auto end = std::lower_bound(weights.begin(), weights.end(), limit);
    return static_cast<double>(end - weights.begin()) / static_cast<double>(weights.size());
  };
  const auto at = [&](double share) {
    return weights[static_cast<std::size_t>(share * static_cast<double>(weights.size() - 1))];
  };
  return {Cell(at(0.5), 2), Cell(at(1), 0), Cell(below(0.5F), 3), Cell(below(1), 3),
          Cell(1 - below(255.5F), 3)};
}

struct Job {
  std::size_t setting;
  std::size_t method;
  ScoreCells scores;
  std::vector<std::string> weights;
};

// Maps and scores every setting with every method; a line each when it is done.
std::vector<Job> RunJobs(const SmallScene& scene, const std::vector<Setting>& settings,
                         const Footage& footage) {
  const auto& [reveal, truth] = *footage.truth_from.begin();
  std::vector<Job> jobs;
  for (std::size_t s = 0; s < settings.size(); ++s) {
    for (std::size_t m = 0; m < kFloatMethods.size(); ++m) jobs.push_back({s, m, {}, {}});
  }
  // The references have one thread each. An evaluation has all, so there is one at a time.
  std::atomic<std::size_t> next = 0;
  std::mutex evaluating;
  const auto work = [&, reveal = reveal, &truth = truth] {
    for (std::size_t i = next++; i < jobs.size(); i = next++) {
      Job& job = jobs[i];
      const FloatConfig& config = settings[job.setting].config;
      const auto map = MapFloats(footage, reveal, kFloatMethods[job.method], config);
      job.weights = WeightCells(*map);
      SceneMeshes meshes = MeshesOfFloats(*map, scene.movers);
      const std::lock_guard lock(evaluating);
      LastSeenStores last_seen = MakeLastSeenStores(*truth);
      job.scores = CellsOf(EvaluateMeshes(std::move(meshes), *truth, footage.names, scene.movers,
                                          config.voxel_m, last_seen),
                           scene.movers);
      fmt::print("{}, {}, {}:", scene.name, settings[job.setting].name,
                 kFloatMethods[job.method].name);
      for (std::size_t k = 0; k < kScores.size(); ++k) {
        fmt::print(" {} {}", kScores[k].title, job.scores[k]);
      }
      fmt::print("\n");
      std::fflush(stdout);
    }
  };
  std::vector<std::jthread> threads;
  for (unsigned i = 0; i < std::max(1U, std::thread::hardware_concurrency()); ++i) {
    threads.emplace_back(work);
  }
  threads.clear();  // waits
  return jobs;
}

// A row a setting, a column a score and method.
FigureTable ScoreTable(const std::vector<Setting>& settings, const std::vector<Job>& jobs) {
  std::vector<std::string> columns{"setting"};
  for (const Score& score : kScores) {
    for (const FloatMethod& method : kFloatMethods) {
      columns.push_back(fmt::format("{} {}", score.title, method.name));
    }
  }
  FigureTable table(std::move(columns));
  for (std::size_t s = 0; s < settings.size(); ++s) {
    std::vector<std::string> row{settings[s].name};
    for (std::size_t k = 0; k < kScores.size(); ++k) {
      for (std::size_t m = 0; m < kFloatMethods.size(); ++m) {
        row.push_back(jobs[s * kFloatMethods.size() + m].scores[k]);
      }
    }
    table.Add(std::move(row));
  }
  return table;
}

Expected<void> MeasureScene(const SmallScene& scene, const std::vector<Setting>& settings,
                            const ReleasedOptions& options, FigureTable& weights) {
  TSDFPP_ASSIGN(const Footage footage,
                Film({scene.Path(), scene.scale, scene.step, scene.reveal, {scene.reveal}}));
  const std::vector<Job> jobs = RunJobs(scene, settings, footage);
  TSDFPP_RETURN_IF_ERROR(ScoreTable(settings, jobs).Write(options.out, scene.name));
  for (const Job& job : jobs) {
    const std::string& name = settings[job.setting].name;
    if (name != kOursName && name != kReleasedName && name != kRaysName) continue;
    std::vector<std::string> row{scene.name, name, kFloatMethods[job.method].name};
    row.insert(row.end(), job.weights.begin(), job.weights.end());
    weights.Add(std::move(row));
  }
  return {};
}

}  // namespace

Expected<void> RunReleased(const ReleasedOptions& options) {
  const std::vector<SmallScene>& scenes = SmallScenes();
  for (const std::string& wanted : options.scenes) {
    if (std::none_of(scenes.begin(), scenes.end(),
                     [&](const SmallScene& scene) { return scene.name == wanted; })) {
      return UsageError("--scenes has '{}', expected some of mini and toycar3", wanted);
    }
  }
  std::vector<Setting> settings = Settings();
  for (const std::string& wanted : options.settings) {
    if (std::none_of(settings.begin(), settings.end(),
                     [&](const Setting& setting) { return setting.name == wanted; })) {
      return UsageError("--settings has '{}', expected some of the rows' names in docs/released.md",
                        wanted);
    }
  }
  if (!options.settings.empty()) {
    std::erase_if(settings, [&](const Setting& setting) {
      return std::find(options.settings.begin(), options.settings.end(), setting.name) ==
             options.settings.end();
    });
  }
  TSDFPP_RETURN_IF_ERROR(MakeWritableFolder(options.out));
  FigureTable weights({"scene", "setting", "map", "median weight", "largest", "share below 0.5",
                       "share below 1", "share above 255"});
  for (const SmallScene& scene : scenes) {
    if (std::find(options.scenes.begin(), options.scenes.end(), scene.name) ==
        options.scenes.end()) {
      continue;
    }
    const auto start = std::chrono::steady_clock::now();
    TSDFPP_RETURN_IF_ERROR(MeasureScene(scene, settings, options, weights));
    const double seconds =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    fmt::print("{}: {}/{}.csv ({:.0f} s)\n", scene.name, options.out, scene.name, seconds);
    std::fflush(stdout);
  }
  return weights.Write(options.out, "weights");
}

}  // namespace tsdfpp
