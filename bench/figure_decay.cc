#include <array>
#include <cmath>
#include <optional>

#include "bench/figure_runs.h"
#include "bench/figures.h"

namespace tsdfpp {
namespace {

constexpr const char* kDecayScene = "scenes/toycar3.toml";
constexpr int kFusedFrames = 12;  // the cars start at frame 20
constexpr int kFirstMove = 24;
constexpr int kMoves = 100;
constexpr std::array<int, 8> kShown{0, 1, 3, 5, 7, 10, 30, 100};
constexpr std::array<InstanceId, 2> kCars{1, 2};

struct Way {
  const char* name;
  Method method;
  Resampling resampling;
};
constexpr std::array<Way, 8> kWays{
    {{"tsdf", Method::kTsdf, Resampling::kAll},
     {"tsdf observed", Method::kTsdf, Resampling::kObserved},
     {"tsdf nearest", Method::kTsdf, Resampling::kNearest},
     {"tsdf++/literal", Method::kTsdfppLiteral, Resampling::kAll},
     {"tsdf++", Method::kTsdfpp, Resampling::kAll},
     {"tsdf++ observed", Method::kTsdfpp, Resampling::kObserved},
     {"tsdf++ nearest", Method::kTsdfpp, Resampling::kNearest},
     {"tsdf++/anchored", Method::kTsdfppAnchored, Resampling::kAll}}};

using Rgb = Eigen::Vector3d;

// The reconstruction of one car against the samples of it that the fused frames saw.
struct Remains {
  double seen_m2 = 0;
  double left_m2 = 0;
  std::optional<double> rmse_m;            // of the mesh to the truth
  std::vector<std::optional<Rgb>> colour;  // by sample, where there is surface within a voxel
};

Rgb TriangleColour(const TriangleMesh& mesh, std::size_t triangle) {
  Rgb sum = Rgb::Zero();
  for (const std::uint32_t vertex : mesh.triangles[triangle]) {
    for (std::size_t c = 0; c < 3; ++c) sum[static_cast<int>(c)] += mesh.colours[vertex][c];
  }
  return sum / 3;
}

Remains Examine(const MapRepresentation& map, const SceneTruth& truth, InstanceId id,
                const Pose& T_WO, double voxel_m) {
  const auto& trackers = truth.trackers();
  std::size_t at = 0;
  while (trackers[at].id() != id) ++at;
  const SampleSet& samples = trackers[at].samples_O();
  const Selection seen = SelectSeen(trackers[at], SelectAll(samples));
  const TriangleMesh mesh = map.ObjectMesh(id);
  const SurfaceIndex surface(mesh);
  const SampleMatch match = MatchSamples(samples, seen, T_WO, surface, voxel_m);
  const Selection left = Reconstructed(match, voxel_m);
  Remains remains;
  remains.seen_m2 = SelectedArea_m2(samples, seen);
  Selection both = seen;
  for (std::size_t i = 0; i < both.size(); ++i) both[i] = seen[i] & left[i];
  remains.left_m2 = SelectedArea_m2(samples, both);
  const std::array<double, 1> threshold{voxel_m};
  remains.rmse_m = ScoreAccuracy(SampleReconstruction(mesh, {}), {&truth.surface(at), T_WO},
                                 std::nullopt, threshold)
                       .distance.rmse_m.value;
  remains.colour.resize(samples.size());
  if (mesh.triangles.empty()) return remains;
  const NearestSurface nearest = surface.Nearest(TransformPoints(T_WO, samples.points));
  for (std::size_t i = 0; i < both.size(); ++i) {
    if (both[i] != 0) remains.colour[i] = TriangleColour(mesh, nearest.triangle[i]);
  }
  return remains;
}

// What fading does to the samples that have colour both before and after.
struct Fading {
  double error_levels = 0;     // mean of |after - before| over samples and channels
  double brighter_levels = 0;  // mean of after - before
  bool defined = false;
};

Fading CompareColours(const std::array<std::vector<std::optional<Rgb>>, kCars.size()>& before,
                      const std::array<std::vector<std::optional<Rgb>>, kCars.size()>& after) {
  Fading fading;
  double count = 0;
  for (std::size_t car = 0; car < before.size(); ++car) {
    for (std::size_t i = 0; i < before[car].size(); ++i) {
      if (!before[car][i] || !after[car][i]) continue;
      fading.error_levels += (*after[car][i] - *before[car][i]).cwiseAbs().mean();
      fading.brighter_levels += (*after[car][i] - *before[car][i]).mean();
      ++count;
    }
  }
  if (count == 0) return fading;
  return {fading.error_levels / count, fading.brighter_levels / count, true};
}

class Decay {
 public:
  Decay(const Footage& fused, const std::vector<Frame>& moves, FigureTable& table)
      : fused_(fused), truth_(*fused.truth_from.begin()->second), moves_(moves), table_(table) {}

  void Measure(const Way& way) const {
    PipelineConfig config;
    config.method = way.method;
    config.map.resampling = way.resampling;
    std::unique_ptr<MapRepresentation> start;
    MapFootage(fused_, config, {kFusedFrames},
               [&](int, const MapRepresentation& map) { start = map.Clone(); });
    const Shown first = Take(*start, fused_.frames.back());
    Show(way, "0", first, first);
    const auto map = start->Clone();
    for (int move = 1; move <= kMoves; ++move) {
      const Frame& frame = moves_[static_cast<std::size_t>(move - 1)];
      Move(*map, frame);
      if (std::find(kShown.begin(), kShown.end(), move) != kShown.end()) {
        Show(way, std::to_string(move), first, Take(*map, frame));
      }
    }
    Move(*start, moves_.back());
    Show(way, "one over the whole path", first, Take(*start, moves_.back()));
  }

 private:
  struct Shown {
    double seen_m2 = 0;
    double left_m2 = 0;
    double square_m2 = 0;
    int counted = 0;
    std::array<std::vector<std::optional<Rgb>>, kCars.size()> colour;
  };

  static void Move(MapRepresentation& map, const Frame& frame) {
    for (const InstanceId id : kCars) map.SetObjectPose(id, frame.T_WO.at(id));
  }

  Shown Take(const MapRepresentation& map, const Frame& frame) const {
    Shown shown;
    for (std::size_t car = 0; car < kCars.size(); ++car) {
      Remains remains =
          Examine(map, truth_, kCars[car], frame.T_WO.at(kCars[car]), MapConfig{}.voxel_m);
      shown.seen_m2 += remains.seen_m2;
      shown.left_m2 += remains.left_m2;
      if (remains.rmse_m) {
        shown.square_m2 += *remains.rmse_m * *remains.rmse_m;
        ++shown.counted;
      }
      shown.colour[car] = std::move(remains.colour);
    }
    return shown;
  }

  void Show(const Way& way, const std::string& moves, const Shown& first, const Shown& now) const {
    const Fading fading = CompareColours(first.colour, now.colour);
    table_.Add({way.name, moves, Cell(now.left_m2 / now.seen_m2, 3),
                now.counted == 0 ? "" : Cell(1e3 * std::sqrt(now.square_m2 / now.counted), 2),
                fading.defined ? Cell(fading.error_levels, 1) : "",
                fading.defined ? Cell(fading.brighter_levels, 1) : ""});
  }

  const Footage& fused_;
  const SceneTruth& truth_;
  const std::vector<Frame>& moves_;
  FigureTable& table_;
};

}  // namespace

Expected<void> MeasureDecay(const FigureOptions& options) {
  TSDFPP_ASSIGN(const Footage fused, Film({kDecayScene, 1, 1, kFusedFrames, {kFusedFrames}}));
  // Only the poses of these frames are used.
  TSDFPP_ASSIGN(Footage path, Film({kDecayScene, 0.1, 1, kFirstMove + kMoves - 1, {}}));
  std::erase_if(path.frames, [](const Frame& frame) { return frame.index < kFirstMove; });
  FigureTable table({"map", "moves", "surface left", "distance error mm", "colour error levels",
                     "brighter by levels"});
  const Decay decay(fused, path.frames, table);
  for (const Way& way : kWays) decay.Measure(way);
  return table.Write(options.out, "decay");
}

}  // namespace tsdfpp
