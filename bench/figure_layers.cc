#include <array>
#include <cmath>

#include "bench/figure_runs.h"
#include "bench/figures.h"
#include "mapper/voxel_inspection.h"
#include "metrics/mesh_tools.h"

namespace tsdfpp {
namespace {

constexpr const char* kLayersScene = "scenes/stack.toml";
// Cover over ball over tray; then the pile was pushed to where bare table had been seen.
constexpr int kThreeSurfaces = 203;
constexpr int kFourSurfaces = 262;
constexpr double kScale = 0.5;  // of the images
constexpr int kStep = 4;        // frames
constexpr InstanceId kTray = 1;
constexpr InstanceId kBall = 2;
constexpr InstanceId kCover = 3;

struct Layering {
  Method method;
  int layers = 0;  // 0 where the method has none to choose
  Resampling resampling = Resampling::kAll;

  std::string Name() const {
    return fmt::format("{}{}", MethodName(method),
                       resampling == Resampling::kObserved ? " observed" : "");
  }
};
constexpr std::array<Layering, 13> kLayerings{{{Method::kTsdfStatic},
                                               {Method::kTsdf},
                                               {Method::kTsdfGuarded},
                                               {Method::kTsdfppLiteral},
                                               {Method::kTsdfpp, 2},
                                               {Method::kTsdfpp, 3},
                                               {Method::kTsdfpp, 4},
                                               {Method::kTsdfpp, 2, Resampling::kObserved},
                                               {Method::kTsdfpp, 3, Resampling::kObserved},
                                               {Method::kTsdfpp, 4, Resampling::kObserved},
                                               {Method::kTsdfppAnchored, 2},
                                               {Method::kTsdfppAnchored, 3},
                                               {Method::kTsdfppAnchored, 4}}};

// Of the hidden samples of tracker i those whose nearest voxel lists the object: what a ray or a
// query through the index can find.
Measured ListedShare(const MapRepresentation& map, const SceneTruth& truth, std::size_t i,
                     const Selection& hidden, double voxel_m) {
  const SampleSet& samples = truth.trackers()[i].samples_O();
  const std::vector<Eigen::Vector3f> points_W = TransformPoints(truth.T_WO(i), samples.points);
  Selection listed(samples.size());
  for (std::size_t k = 0; k < samples.size(); ++k) {
    if (hidden[k] == 0) continue;
    const Eigen::Vector3i voxel =
        (points_W[k].cast<double>() / voxel_m + Eigen::Vector3d::Constant(0.5))
            .array()
            .floor()
            .cast<int>();
    for (const Listing& entry : VoxelsOf(map).ListAt(voxel)) {
      if (entry.id == truth.trackers()[i].id()) listed[k] = 1;
    }
  }
  return ShareOf(samples, hidden, listed, "nothing seen is behind another object");
}

// The samples of the pile's part that are hidden under what lies on it: for the table those under
// the tray, within its radius.
Selection HiddenInPile(const SceneTruth& truth, std::size_t i, const Eigen::Vector3d& pile_W) {
  constexpr double kTrayRadius_m = 0.10;
  const SeenTracker& tracker = truth.trackers()[i];
  Selection hidden =
      SelectSeenWith(tracker, SampleStatus::kBehindOther, SelectAll(tracker.samples_O()));
  if (tracker.id() != kBackground) return hidden;
  const auto points_W = TransformPoints(truth.T_WO(i), tracker.samples_O().points);
  for (std::size_t k = 0; k < hidden.size(); ++k) {
    const Eigen::Vector3d p = points_W[k].cast<double>();
    if ((p - pile_W).head<2>().norm() > kTrayRadius_m || std::abs(p.z() - pile_W.z()) > 0.03) {
      hidden[k] = 0;
    }
  }
  return hidden;
}

// Three cells an object: listed as it is, listed and meshed once all above it was removed.
void MeasureMap(const MapRepresentation& map, const SceneTruth& truth, bool on_seen_table,
                std::vector<std::string>& row, double voxel_m) {
  const std::size_t tray = kTray;  // trackers are by increasing id, the background first
  const Eigen::Vector3d pile_W = truth.T_WO(tray).translation();
  for (const InstanceId id : {kBackground, kTray, kBall}) {
    if (id == kBackground && !on_seen_table) {
      row.insert(row.end(), 3, "");
      continue;
    }
    const auto uncovered = map.Clone();
    for (const InstanceId above : {kTray, kBall, kCover}) {
      if (above > id) uncovered->Remove(above);
    }
    const auto i = static_cast<std::size_t>(id);
    const SampleSet& samples = truth.trackers()[i].samples_O();
    const Selection hidden = HiddenInPile(truth, i, pile_W);
    const SurfaceIndex faces(FacesOf(uncovered->SceneMesh(), id));
    const Selection kept =
        Reconstructed(MatchSamples(samples, hidden, truth.T_WO(i), faces, voxel_m), voxel_m);
    row.push_back(Cell(ListedShare(map, truth, i, hidden, voxel_m)));
    row.push_back(Cell(ListedShare(*uncovered, truth, i, hidden, voxel_m)));
    row.push_back(Cell(ShareOf(samples, hidden, kept, "nothing is hidden")));
  }
}

}  // namespace

Expected<void> MeasureLayers(const FigureOptions& options) {
  TSDFPP_ASSIGN(
      const Footage footage,
      Film({kLayersScene, kScale, kStep, kFourSurfaces, {kThreeSurfaces, kFourSurfaces}}));
  FigureTable table({"surfaces", "profile", "map", "K", "table listed", "table after",
                     "table in mesh", "tray listed", "tray after", "tray in mesh", "ball listed",
                     "ball after", "ball in mesh"});
  const std::set<int> moments = TruthFrames(footage);
  std::map<int, std::vector<std::vector<std::string>>> rows;  // by moment
  for (const char* profile : {"paper", "close"}) {
    for (const Layering& layering : kLayerings) {
      PipelineConfig config;
      config.method = layering.method;
      TSDFPP_RETURN_IF_ERROR(config.map.SetProfile(profile));
      config.map.layers = layering.layers;
      config.map.resampling = layering.resampling;
      MapFootage(footage, config, moments, [&](int frame, const MapRepresentation& map) {
        const bool pushed = frame != *moments.begin();
        std::vector<std::string> row{pushed ? "4" : "3", profile, layering.Name(),
                                     std::to_string(LayersOf(config.method, config.map))};
        MeasureMap(map, *footage.truth_from.at(frame), pushed, row, config.map.voxel_m);
        rows[frame].push_back(std::move(row));
      });
    }
  }
  for (auto& [frame, of_frame] : rows) {
    for (auto& row : of_frame) table.Add(std::move(row));
  }
  return table.Write(options.out, "layers");
}

}  // namespace tsdfpp
