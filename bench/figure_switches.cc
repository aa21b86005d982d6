#include <array>
#include <functional>
#include <numbers>

#include "bench/figure_runs.h"
#include "bench/figures.h"
#include "core/random.h"

namespace tsdfpp {
namespace {

constexpr const char* kSwitchesScene = "scenes/mini.toml";
constexpr int kReveal = 40;
constexpr std::array<InstanceId, 1> kMovers{1};

// The movers' poses as a poor tracker would give them: anew off in every frame.
constexpr double kMistracked_m = 0.005;
constexpr double kMistracked_rad = std::numbers::pi / 180;

void Mistrack(Footage& footage) {
  for (Frame& frame : footage.frames) {
    for (const InstanceId id : kMovers) {
      const auto frame_number = static_cast<std::uint64_t>(frame.index);
      const auto shift = GaussianDraw(1, id, frame_number, 0);
      const auto turn = GaussianDraw(1, id, frame_number, 1);
      Pose& T_WO = frame.T_WO.at(id);
      const Eigen::Vector3d axis(turn[0], turn[1], turn[2]);
      T_WO.linear() =
          Eigen::AngleAxisd(kMistracked_rad * turn[3], axis.normalized()) * T_WO.linear();
      T_WO.translation() += kMistracked_m * Eigen::Vector3d(shift[0], shift[1], shift[2]);
    }
  }
}

const std::vector<std::string> kScoreColumns{
    "visible completion", "table visible",   "table kept", "movers completion",
    "ghost cm2",          "ghost cm2 after", "sane",       "sane least"};

// The scores of one map at the reveal, in the order of kScoreColumns.
void AppendScores(const Footage& footage, const PipelineConfig& config,
                  std::vector<std::string>& row) {
  const int frame = footage.truth_from.begin()->first;
  const auto& truth = footage.truth_from.begin()->second;
  LastSeenStores last_seen = MakeLastSeenStores(*truth);
  Evaluation result;
  MapFootage(footage, config, {frame}, [&](int, const MapRepresentation& map) {
    result = Evaluate(map, *truth, footage.names, {kMovers.begin(), kMovers.end()},
                      config.map.voxel_m, last_seen);
  });
  const ObjectScores& table = result.objects.front();
  double movers = 0;
  for (const ObjectScores& object : result.objects) {
    if (std::find(kMovers.begin(), kMovers.end(), object.info.id) == kMovers.end()) continue;
    movers += object.preserved.completion.value.value_or(0) / kMovers.size();
  }
  double least = result.sanity.all.value.value_or(1);
  for (const auto& [id, share] : result.sanity.by_object) {
    least = std::min(least, share.value.value_or(1));
  }
  for (const std::string& cell :
       {Cell(result.visible_completion), Cell(table.visible_completion),
        Cell(table.preserved.preservation_behind_other), Cell(movers, 3),
        Cell(1e4 * result.ghost_area_m2, 0), Cell(1e4 * *result.revealed_ghost_area_m2.value, 0),
        Cell(result.sanity.all), Cell(least, 3)}) {
    row.push_back(cell);
  }
}

std::vector<std::string> Columns(std::vector<std::string> first) {
  first.insert(first.end(), kScoreColumns.begin(), kScoreColumns.end());
  return first;
}

struct Switch {
  const char* name;
  std::function<void(MapConfig&)> set;
  bool moves_values;  // of tsdf++ alone
};

}  // namespace

Expected<void> MeasureSwitches(const FigureOptions& options) {
  TSDFPP_ASSIGN(Footage footage, Film({kSwitchesScene, 1, 1, kReveal, {kReveal}}));
  const std::vector<Switch> switches{
      {"as it is", [](MapConfig&) {}, false},
      {"contradiction = false", [](MapConfig& c) { c.contradiction = false; }, false},
      {"rims = false", [](MapConfig& c) { c.rims = false; }, false},
      {"weight_cap = 200", [](MapConfig& c) { c.weight_cap = 200; }, false},
      {"resampling = observed", [](MapConfig& c) { c.resampling = Resampling::kObserved; }, true},
      {"relist_on_removal = true", [](MapConfig& c) { c.relist_on_removal = true; }, true},
      {"moved_confidence = 4", [](MapConfig& c) { c.moved_confidence = 4; }, true}};
  FigureTable table(Columns({"movers' poses", "profile", "map", "setting"}));
  for (const bool mistracked : {false, true}) {
    if (mistracked) Mistrack(footage);
    for (const char* profile : {"paper", "close"}) {
      for (const Method method : {Method::kTsdfpp, Method::kTsdfppAnchored}) {
        for (const Switch& setting : switches) {
          if (setting.moves_values && (method != Method::kTsdfpp || mistracked)) continue;
          PipelineConfig config;
          config.method = method;
          TSDFPP_RETURN_IF_ERROR(config.map.SetProfile(profile));
          setting.set(config.map);
          std::vector<std::string> row{mistracked ? "5 mm and 1 deg off" : "true", profile,
                                       std::string(MethodName(method)), setting.name};
          AppendScores(footage, config, row);
          table.Add(std::move(row));
        }
      }
    }
  }
  return table.Write(options.out, "switches");
}

Expected<void> MeasureSweep(const FigureOptions& options) {
  TSDFPP_ASSIGN(const Footage footage, Film({kSwitchesScene, 1, 1, kReveal, {kReveal}}));
  FigureTable table(Columns({"map", "back voxels"}));
  for (const Method method :
       {Method::kTsdfStatic, Method::kTsdf, Method::kTsdfMin, Method::kTsdfGuarded, Method::kTsdfpp,
        Method::kTsdfppLiteral, Method::kTsdfppAnchored}) {
    for (int back = 2; back <= 10; ++back) {
      PipelineConfig config;
      config.method = method;
      config.map.trunc_back_voxels = back;
      std::vector<std::string> row{std::string(MethodName(method)), std::to_string(back)};
      AppendScores(footage, config, row);
      table.Add(std::move(row));
    }
  }
  return table.Write(options.out, "sweep");
}

}  // namespace tsdfpp
