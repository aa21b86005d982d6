#include "bench/terms.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include "bench/figure_runs.h"
#include "bench/track_runs.h"
#include "bench/track_scores.h"
#include "metrics/statistics.h"
#include "sim/simulated_source.h"

namespace tsdfpp {
namespace {

constexpr InstanceId kThing = 1;
constexpr int kFrames = 75;
constexpr double kColourNoise_levels = 2;

struct BenchShape {
  std::string name;
  std::string model;
  std::optional<Eigen::Vector3d> size_m{};
};
const std::vector<BenchShape>& BenchShapes() {
  static const std::vector<BenchShape> kShapes{
      {"box", "brick", Eigen::Vector3d(0.16, 0.09, 0.1)},
      {"cylinder", "cylinder", Eigen::Vector3d(0.1, 0.1, 0.14)},
      {"ball", "sphere", Eigen::Vector3d(0.12, 0.12, 0.12)},
      {"mug", "mug"},
      {"car", "car"}};
  return kShapes;
}

struct TermSet {
  std::string name;
  SdfTrackConfig config;
};
SdfTrackConfig With(double free_space, double outline, double colour, bool expects) {
  SdfTrackConfig config;
  config.free_space_weight = free_space;
  config.outline_weight = outline;
  config.colour_weight = colour;
  if (!expects) config.weak_share = 0;
  return config;
}
const std::vector<TermSet>& TermSets() {
  static const std::vector<TermSet> kSets{
      {"distance", With(0, 0, 0, false)},         {"+ free space", With(1, 0, 0, false)},
      {"+ outline", With(1, 1, 0, false)},        {"+ colour", With(1, 1, 1, false)},
      {"+ expectation", With(1, 1, 1, true)},     {"distance and expectation", With(0, 0, 0, true)},
      {"these and outline", With(0, 1, 0, true)}, {"these and colour", With(0, 0, 1, true)},
      {"these and both", With(0, 1, 1, true)}};
  return kSets;
}

// `names` of what there is; all where there are none.
template <typename T>
Expected<std::vector<T>> Chosen(const std::vector<T>& all, const std::vector<std::string>& names,
                                const std::string& option) {
  if (names.empty()) return all;
  std::vector<T> chosen;
  for (const std::string& name : names) {
    const auto it = std::ranges::find(all, name, &T::name);
    if (it == all.end()) {
      std::string known;
      for (const T& one : all) known += (known.empty() ? "" : ", ") + one.name;
      return UsageError("{}: found '{}', expected some of: {}", option, name, known);
    }
    chosen.push_back(*it);
  }
  return chosen;
}

Eigen::Quaterniond Heading(double yaw_deg) { return FromRollPitchYaw({0, 0, yaw_deg}); }

SceneConfig SceneOf(const BenchShape& shape, bool has_pattern) {
  SceneConfig scene;
  scene.name = "terms";
  scene.frames = kFrames;
  scene.intrinsics = {640, 480, 525, 525, 319.5, 239.5};
  scene.camera.path = ArcPath{{0, 0, kTableTop_m}, {-90, -90}, {0.98, 0.98}, {0.62, 0.62}};
  SceneObject object;
  object.name = shape.name;
  object.id = kThing;
  object.semantic_class = shape.name;
  object.model.name = shape.model;
  object.model.size_m = shape.size_m;
  if (has_pattern) object.model.material = "marble";
  object.x = -0.1;
  const auto at = [](double x) { return Eigen::Vector3d(x, 0, kTableTop_m); };
  object.keyframes = {{5, at(-0.1), Heading(0)},
                      {30, at(0.08), Heading(0)},
                      {55, at(0.08), Heading(60)},
                      {kFrames, at(-0.04), Heading(20)}};
  scene.objects.push_back(object);
  return scene;
}

struct Scored {
  double shift_mm = 0;
  double turn_deg = 0;
  double add_s_mm = 0;
  double free_directions = 0;
  double frozen = 0;
  double ms = 0;
};

double MedianBy(const std::vector<Scored>& all, double Scored::*value) {
  std::vector<double> values;
  values.reserve(all.size());
  for (const Scored& one : all) values.push_back(one.*value);
  return MedianOf(values);
}

Expected<Scored> Follow(const std::vector<Frame>& frames, const SequenceInfo& info,
                        const TriangleMesh& mesh_O, const PipelineConfig& config) {
  const auto run = MakeMapRun(info.objects, config);
  TrackedObject object;
  for (const Frame& frame : frames) {
    TSDFPP_RETURN_IF_ERROR(run->Process(frame));
    object.T_WO_truth[frame.index] = frame.T_WO.at(kThing);
    object.shown.insert(frame.index);
  }
  object.T_WO_estimate = run->trajectories().at(kThing);
  object.points_O = SomePoints(mesh_O);
  const auto motions = run->log().motions().find(kThing);
  if (motions != run->log().motions().end()) object.motions = motions->second;
  const TrackScores scores = ScoreTracked(object);
  std::vector<double> ms;
  for (const TrackRun::Cost& cost : run->costs()) ms.push_back(cost.track_ms / cost.objects);
  return Scored{1e3 * *scores.trajectory.ate_rmse_m.value,
                *scores.trajectory.rotation_rmse_deg.value,
                1e3 * *scores.add_s_m.value,
                scores.free_directions,
                static_cast<double>(run->log().objects().at(kThing).frozen),
                ms.empty() ? 0 : MedianOf(ms)};
}

struct Row {
  std::string shape;
  std::string paint;
  std::string depth;
  std::vector<std::vector<Scored>> by_set{};  // each of all draws
};

struct Plan {
  std::vector<TermSet> sets;
  Method method{};
  int seeds = 1;
};

// Both depths of one shape.
Expected<std::vector<Row>> RunShape(const BenchShape& shape, bool has_pattern, const Plan& plan) {
  TSDFPP_ASSIGN(const auto source, SimulatedSource::Open(SceneOf(shape, has_pattern), {}));
  TSDFPP_ASSIGN(const std::vector<TrueModel> models, source->Truth());
  const SequenceInfo& info = source->info();
  const auto model =
      std::ranges::find(models, kThing, [](const TrueModel& m) { return m.info.id; });
  TSDFPP_ASSIGN(SensorConfig noisy, SensorPresetNamed("nguyen2012"));
  noisy.colour.noise_levels = kColourNoise_levels;
  std::vector<Row> rows;
  for (const bool is_noisy : {false, true}) {
    Row row{shape.name, has_pattern ? "pattern" : "plain", is_noisy ? "noise" : "exact"};
    row.by_set.resize(plan.sets.size());
    for (int seed = 1; seed <= (is_noisy ? plan.seeds : 1); ++seed) {
      std::vector<Frame> frames;
      for (int index = info.first_index; index < info.first_index + info.frame_count; ++index) {
        TSDFPP_ASSIGN(Frame frame, source->ReadTrue(index));
        if (is_noisy) {
          TSDFPP_ASSIGN(const SensedTruth ignored,
                        ApplySensor(noisy, static_cast<std::uint64_t>(seed), info, frame));
        }
        frames.push_back(std::move(frame));
      }
      for (std::size_t i = 0; i < plan.sets.size(); ++i) {
        PipelineConfig config{.method = plan.method,
                              .poses = PoseSource::kTrack,
                              .tracked = TrackChoice::kAll,
                              .track = plan.sets[i].config};
        TSDFPP_ASSIGN(const Scored scored, Follow(frames, info, model->mesh_O, config));
        row.by_set[i].push_back(scored);
      }
    }
    rows.push_back(std::move(row));
  }
  return rows;
}

Expected<void> WriteTables(const std::vector<Row>& rows, const std::vector<TermSet>& sets,
                           const std::string& out) {
  FigureTable all({"shape", "paint", "depth", "terms", "shift mm", "turn deg", "ADD-S mm",
                   "free directions", "frozen", "ms"});
  std::vector<std::string> columns{"shape", "paint", "depth"};
  for (const TermSet& set : sets) columns.push_back(set.name);
  FigureTable summary(columns);
  for (const Row& row : rows) {
    std::vector<std::string> cells{row.shape, row.paint, row.depth};
    for (std::size_t i = 0; i < sets.size(); ++i) {
      const std::vector<Scored>& of = row.by_set[i];
      const std::string shift = Cell(MedianBy(of, &Scored::shift_mm), 2);
      const std::string turn = Cell(MedianBy(of, &Scored::turn_deg), 2);
      all.Add({row.shape, row.paint, row.depth, sets[i].name, shift, turn,
               Cell(MedianBy(of, &Scored::add_s_mm), 2),
               Cell(MedianBy(of, &Scored::free_directions), 1),
               Cell(MedianBy(of, &Scored::frozen), 0), Cell(MedianBy(of, &Scored::ms), 2)});
      cells.push_back(fmt::format("{} / {}", shift, turn));
    }
    summary.Add(cells);
  }
  TSDFPP_RETURN_IF_ERROR(all.Write(out, "terms"));
  return summary.Write(out, "summary");
}

}  // namespace

Expected<void> RunTermsBench(const TermsBenchOptions& options) {
  Plan plan;
  plan.seeds = options.seeds;
  TSDFPP_ASSIGN(plan.method, MethodFromName(options.method));
  TSDFPP_ASSIGN(plan.sets, Chosen(TermSets(), options.sets, "--sets"));
  TSDFPP_ASSIGN(const std::vector<BenchShape> shapes,
                Chosen(BenchShapes(), options.shapes, "--shapes"));
  std::vector<Row> rows;
  for (const BenchShape& shape : shapes) {
    for (const bool has_pattern : {false, true}) {
      TSDFPP_ASSIGN(const std::vector<Row> of_shape, RunShape(shape, has_pattern, plan));
      for (const Row& row : of_shape) {
        for (std::size_t i = 0; i < plan.sets.size(); ++i) {
          std::printf("%s, %s, %s, %s: %.2f mm, %.2f deg, ADD-S %.2f mm, frozen %.0f, %.2f ms\n",
                      row.shape.c_str(), row.paint.c_str(), row.depth.c_str(),
                      plan.sets[i].name.c_str(), MedianBy(row.by_set[i], &Scored::shift_mm),
                      MedianBy(row.by_set[i], &Scored::turn_deg),
                      MedianBy(row.by_set[i], &Scored::add_s_mm),
                      MedianBy(row.by_set[i], &Scored::frozen),
                      MedianBy(row.by_set[i], &Scored::ms));
        }
        std::fflush(stdout);
        rows.push_back(row);
      }
    }
  }
  return WriteTables(rows, plan.sets, options.out);
}

}  // namespace tsdfpp
