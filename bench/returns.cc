#include "bench/returns.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <map>
#include <numeric>
#include <set>
#include <vector>

#include "bench/figure_runs.h"
#include "bench/return_scenes.h"
#include "bench/track_scores.h"
#include "core/toml_reader.h"
#include "mapper/pipeline.h"
#include "metrics/object_pose.h"
#include "metrics/statistics.h"
#include "sim/sensor/sensor.h"
#include "sim/simulated_source.h"

namespace tsdfpp {
namespace {

constexpr std::array kKinds{ReturnKind::kCarried, ReturnKind::kTwo, ReturnKind::kHidden,
                            ReturnKind::kMoved};
constexpr int kReplacedShare = 6;  // one case in so many besides
// An object is back in the first frame, after it was out of sight, that shows so much of what the
// last frame shows of it, clear of the picture's edge.
constexpr double kBackShare = 0.5;
constexpr int kEdge_px = 3;

// What one frame shows of one true object, and as what.
struct Sight {
  int pixels = 0;
  bool is_at_edge = false;
  std::map<InstanceId, int> labels{};
  // The label of at least half of the pixels, or kNoInstance.
  InstanceId Label() const {
    for (const auto& [id, count] : labels) {
      if (2 * count >= pixels) return id;
    }
    return kNoInstance;
  }
};

std::map<InstanceId, Sight> SightsOf(const cv::Mat& truth, const cv::Mat& labels) {
  std::map<InstanceId, Sight> sights;
  for (int v = 0; v < truth.rows; ++v) {
    for (int u = 0; u < truth.cols; ++u) {
      const InstanceId id = truth.at<InstanceId>(v, u);
      if (id == kBackground || id == kNoInstance) continue;
      Sight& sight = sights[id];
      ++sight.pixels;
      ++sight.labels[labels.at<InstanceId>(v, u)];
      sight.is_at_edge =
          sight.is_at_edge || std::min({u, v, truth.cols - 1 - u, truth.rows - 1 - v}) < kEdge_px;
    }
  }
  return sights;
}

struct Row {
  ReturnKind kind{};
  std::uint64_t seed = 0;
  std::string object{};
  std::string outcome{};  // right, wrong, new or none
  int delay = -1;         // frames from the object's return to its id, -1 without
  double add_s_m = -1;    // at the last frame, -1 where the outcome is another
  int begun_anew = 0;
  double slowest_ms = 0;
};

struct Plan {
  SensorConfig sensor{};
  PipelineConfig pipeline{};
};

Expected<Plan> PlanOf(const ReturnBenchOptions& options) {
  Plan plan;
  if (options.depth != "noise" && options.depth != "exact") {
    return UsageError("--depth: expected exact or noise, found '{}'", options.depth);
  }
  TSDFPP_ASSIGN(plan.sensor, SensorPresetNamed(options.depth == "noise" ? "nguyen2012+masks_redrawn"
                                                                        : "masks_redrawn"));
  TSDFPP_ASSIGN(plan.pipeline.method, MethodFromName(options.method));
  plan.pipeline.associate = AssociationMode::kVotes;
  plan.pipeline.poses = PoseSource::kTrack;
  plan.pipeline.tracked = TrackChoice::kAll;
  if (!options.settings.empty()) {
    TSDFPP_ASSIGN(const toml::table table, ParseTomlFile(options.settings));
    TSDFPP_ASSIGN(plan.pipeline.track, SdfTrackConfig::FromToml(table, options.settings));
  }
  TSDFPP_RETURN_IF_ERROR(plan.pipeline.Validate());
  return plan;
}

struct Run {
  std::vector<std::map<InstanceId, Sight>> sights{};  // by frame
  std::map<InstanceId, std::map<int, Pose>> truth{};
  std::map<InstanceId, std::map<int, Pose>> trajectories{};
  std::map<InstanceId, std::vector<Eigen::Vector3f>> points_O{};
  TrackLog log{};
  double slowest_ms = 0;  // tracking one frame
};

Expected<Run> RunCase(const ReturnScene& drawn, const Plan& plan) {
  TSDFPP_ASSIGN(const auto source, SimulatedSource::Open(drawn.scene, {}));
  Run run;
  TSDFPP_ASSIGN(const std::vector<TrueModel> models, source->Truth());
  for (const TrueModel& model : models) {
    run.points_O[model.info.id] = SomePoints(model.mesh_O);
  }
  Pipeline pipeline(plan.pipeline, {});
  const SequenceInfo& info = source->info();
  for (int index = info.first_index; index < info.first_index + info.frame_count; ++index) {
    TSDFPP_ASSIGN(Frame frame, source->ReadTrue(index));
    const cv::Mat truth = frame.mask.clone();
    for (const auto& [id, T_WO] : frame.T_WO) run.truth[id][index] = T_WO;
    TSDFPP_ASSIGN(const SensedTruth ignored,
                  ApplySensor(plan.sensor, drawn.scene.seed, info, frame));
    frame.T_WO.clear();
    TSDFPP_ASSIGN(const StepTimes times, pipeline.Process(frame));
    run.slowest_ms = std::max(run.slowest_ms, 1e3 * times.track_s);
    run.sights.push_back(SightsOf(truth, pipeline.labels()));
  }
  run.trajectories = pipeline.trajectories();
  run.log = pipeline.track_log();
  return run;
}

// ADD-S at the last frame, of the object's place as the motion since `before` gives it.
double PlaceError_m(const Run& run, InstanceId of, InstanceId label, int before) {
  const auto& truth = run.truth.at(of);
  const auto& found = run.trajectories.at(label);
  const int last = truth.rbegin()->first;
  if (!found.contains(before) || !found.contains(last)) return -1;
  const Pose T_WO = found.at(last) * found.at(before).inverse() * truth.at(before);
  return *AddSymmetricError_m(run.points_O.at(of), T_WO, truth.at(last)).value;
}

int PixelsOf(const std::map<InstanceId, Sight>& sights, InstanceId of) {
  const auto sight = sights.find(of);
  return sight == sights.end() ? 0 : sight->second.pixels;
}

Row Judge(const ReturnScene& drawn, const Run& run, InstanceId of) {
  Row row{drawn.kind, drawn.scene.seed};
  for (const SceneObject& object : drawn.scene.objects) {
    if (object.id == of) row.object = object.name;
  }
  const auto before = static_cast<std::size_t>(drawn.last_before - 1);
  InstanceId own = kNoInstance;  // an object may be frozen in some of the frames
  for (std::size_t i = 0; i <= before; ++i) {
    const auto sight = run.sights[i].find(of);
    if (sight != run.sights[i].end() && sight->second.Label() != kNoInstance) {
      own = sight->second.Label();
    }
  }
  std::set<InstanceId> known;  // ids from before anything came back
  std::size_t gone = 0;
  std::size_t back = 0;
  const int least = static_cast<int>(kBackShare * PixelsOf(run.sights.back(), of));
  for (std::size_t i = before; i < run.sights.size(); ++i) {
    const auto sight = run.sights[i].find(of);
    if (sight == run.sights[i].end() || sight->second.pixels < least / 20) gone = i;
    if (gone == 0) {
      for (const auto& [id, seen] : run.sights[i]) known.insert(seen.Label());
    }
    const bool is_whole =
        sight != run.sights[i].end() && sight->second.pixels >= least && !sight->second.is_at_edge;
    if (gone > 0 && back <= gone && is_whole) back = i;
  }
  row.slowest_ms = run.slowest_ms;
  row.outcome = "none";
  if (own == kNoInstance || back == 0) return row;
  for (std::size_t i = back; i < run.sights.size(); ++i) {
    const auto sight = run.sights[i].find(of);
    if (sight == run.sights[i].end()) continue;
    const InstanceId label = sight->second.Label();
    const bool is_decided = row.outcome == "wrong" || row.outcome == "new";
    if (label == own) {
      if (!is_decided) row.outcome = "right";
      if (row.delay < 0) row.delay = static_cast<int>(i - back);
    } else if (label == kNoInstance) {
      if (!is_decided) row.outcome = "none";
    } else if (label == kBackground || known.contains(label)) {
      row.outcome = "wrong";
    } else if (!is_decided) {
      row.outcome = "new";
    }
  }
  if (row.outcome == "right") {
    row.add_s_m = PlaceError_m(run, of, own, drawn.last_before);
    row.begun_anew = run.log.objects().at(own).begun_anew;
  }
  return row;
}

// Of a case in which nothing comes back: whether an object that went is taken for the newcomer.
Row JudgeReplaced(const ReturnScene& drawn, const Run& run) {
  Row row{drawn.kind, drawn.scene.seed, drawn.scene.objects[1].name};
  const auto before = static_cast<std::size_t>(drawn.last_before - 1);
  std::set<InstanceId> known{kBackground};
  for (std::size_t i = 0; i <= before; ++i) {
    for (const auto& [id, seen] : run.sights[i]) known.insert(seen.Label());
  }
  known.erase(kNoInstance);
  row.outcome = "none";
  for (std::size_t i = before + 1; i < run.sights.size(); ++i) {
    const auto sight = run.sights[i].find(drawn.scene.objects[1].id);
    if (sight == run.sights[i].end()) continue;
    const InstanceId label = sight->second.Label();
    if (known.contains(label)) row.outcome = "wrong";
    if (label != kNoInstance && row.outcome == "none") row.outcome = "new";
  }
  return row;
}

Expected<void> WriteCases(const std::vector<Row>& rows, const std::string& out) {
  FigureTable table({"case", "seed", "object", "outcome", "frames until", "ADD-S mm", "begun anew",
                     "slowest ms"});
  for (const Row& row : rows) {
    table.Add({std::string(ReturnKindName(row.kind)), std::to_string(row.seed), row.object,
               row.outcome, row.delay < 0 ? "" : std::to_string(row.delay),
               row.add_s_m < 0 ? "" : Cell(1e3 * row.add_s_m, 1), std::to_string(row.begun_anew),
               Cell(row.slowest_ms, 1)});
  }
  return table.Write(out, "cases");
}

Expected<void> WriteReturns(const std::vector<Row>& rows, const std::string& out) {
  FigureTable table({"case", "objects", "right", "wrong", "new", "none", "frames until: median",
                     "frames until: most", "within a voxel", "begun anew"});
  const auto add = [&](const std::string& name, const auto& is_of) {
    std::map<std::string, int> outcomes;
    std::vector<double> delays;
    int all = 0;
    int near = 0;
    int anew = 0;
    for (const Row& row : rows) {
      if (!is_of(row)) continue;
      ++all;
      ++outcomes[row.outcome];
      if (row.delay >= 0) delays.push_back(row.delay);
      near += row.add_s_m >= 0 && row.add_s_m <= MapConfig{}.voxel_m ? 1 : 0;
      anew += row.begun_anew > 0 ? 1 : 0;
    }
    if (all == 0) return;
    table.Add({name, std::to_string(all), std::to_string(outcomes["right"]),
               std::to_string(outcomes["wrong"]), std::to_string(outcomes["new"]),
               std::to_string(outcomes["none"]), delays.empty() ? "" : Cell(MedianOf(delays), 0),
               delays.empty() ? "" : Cell(*std::ranges::max_element(delays), 0),
               std::to_string(near), std::to_string(anew)});
  };
  for (const ReturnKind kind : kKinds) {
    add(std::string(ReturnKindName(kind)), [&](const Row& row) { return row.kind == kind; });
  }
  add("all that come back", [](const Row& row) { return row.kind != ReturnKind::kReplaced; });
  add(std::string(ReturnKindName(ReturnKind::kReplaced)),
      [](const Row& row) { return row.kind == ReturnKind::kReplaced; });
  return table.Write(out, "returns");
}

}  // namespace

Expected<void> RunReturnBench(const ReturnBenchOptions& options) {
  TSDFPP_ASSIGN(const Plan plan, PlanOf(options));
  std::vector<ReturnKind> kinds;
  kinds.reserve(static_cast<std::size_t>(options.cases + options.cases / kReplacedShare));
  for (int i = 0; i < options.cases; ++i) {
    kinds.push_back(kKinds[static_cast<std::size_t>(i) % kKinds.size()]);
  }
  for (int i = 0; i < options.cases / kReplacedShare; ++i) kinds.push_back(ReturnKind::kReplaced);
  std::vector<Row> rows;
  for (std::size_t i = 0; i < kinds.size(); ++i) {
    const auto seed = static_cast<std::uint64_t>(options.first_seed) + i;
    const ReturnScene drawn = DrawReturnScene(kinds[i], seed);
    TSDFPP_ASSIGN(const Run run, RunCase(drawn, plan));
    std::vector<Row> of_case;
    for (const InstanceId of : drawn.returning) of_case.push_back(Judge(drawn, run, of));
    if (kinds[i] == ReturnKind::kReplaced) of_case.push_back(JudgeReplaced(drawn, run));
    for (const Row& row : of_case) {
      std::printf("%s, seed %d, %s: %s, %d frames, ADD-S %.1f mm%s\n",
                  std::string(ReturnKindName(row.kind)).c_str(), static_cast<int>(row.seed),
                  row.object.c_str(), row.outcome.c_str(), row.delay, 1e3 * row.add_s_m,
                  row.begun_anew > 0 ? ", begun anew" : "");
      rows.push_back(row);
    }
    std::fflush(stdout);
  }
  TSDFPP_RETURN_IF_ERROR(WriteCases(rows, options.out));
  return WriteReturns(rows, options.out);
}

}  // namespace tsdfpp
