#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <span>

#include "bench/figure_runs.h"
#include "bench/figures.h"
#include "core/units.h"
#include "metrics/ghosts.h"

namespace tsdfpp {
namespace {

constexpr double kNear_m = 0.03;
constexpr double kFar_m = 0.09;
constexpr double kNearPlane_m = 0.05;  // as the maps'

struct GhostFootage {
  const char* name;
  FilmPlan plan;
  std::set<InstanceId> movers;
};

// What the frames said of a voxel, and the mean that a map makes of it (docs/map.md).
struct Told {
  bool free = false;  // some frame saw past it
  double mean_m = 0;  // 0 where no frame observed it
};

// What the frames say of the voxels of object `id`, which moves with its pose. Where
// `own_pixels_only`, as in layers, the others' pixels do not count.
class Observations {
 public:
  Observations(const Footage& footage, int last, const MapConfig& map, bool own_pixels_only)
      : footage_(footage), last_(last), map_(map), own_pixels_only_(own_pixels_only) {}

  // `voxel` of the lattice that lies in the world by `T_WL` now.
  const Told& Ask(InstanceId id, const Eigen::Vector3i& voxel, const Pose& T_WL,
                  const Pose& T_WO_now) {
    const auto [place, is_new] =
        told_.try_emplace(std::array<int, 4>{id, voxel.x(), voxel.y(), voxel.z()});
    if (is_new) {
      const Eigen::Vector3d p_W = T_WL * (map_.voxel_m * voxel.cast<double>());
      place->second = Replay(id, T_WO_now.inverse() * p_W);
    }
    return place->second;
  }

 private:
  Told Replay(InstanceId id, const Eigen::Vector3d& p_O) const {
    Told told;
    double weight = 0;
    for (const Frame& frame : footage_.frames) {
      if (frame.index > last_) break;
      const auto pose = frame.T_WO.find(id);
      const Eigen::Vector3d p_W = pose == frame.T_WO.end() ? p_O : pose->second * p_O;
      const Eigen::Vector3d p_C = frame.T_WC.inverse() * p_W;
      const Intrinsics& camera = frame.intrinsics;
      if (p_C.z() < kNearPlane_m) continue;
      const double u = std::floor(camera.fx * p_C.x() / p_C.z() + camera.cx + 0.5);
      const double v = std::floor(camera.fy * p_C.y() / p_C.z() + camera.cy + 0.5);
      if (u < 0 || v < 0 || u >= camera.width || v >= camera.height) continue;
      const float z = frame.depth.at<float>(static_cast<int>(v), static_cast<int>(u));
      if (!IsValidDepth(z)) continue;
      const auto label = frame.mask.at<InstanceId>(static_cast<int>(v), static_cast<int>(u));
      if (own_pixels_only_ && label != id) continue;
      const double s = (static_cast<double>(z) - p_C.z()) * p_C.norm() / p_C.z();
      if (s < -static_cast<double>(map_.back())) continue;
      told.free = told.free || s > 0;
      told.mean_m += (std::min(s, static_cast<double>(map_.front())) - told.mean_m) / (weight + 1);
      weight = std::min(weight + 1, static_cast<double>(map_.weight_cap));
    }
    return told;
  }

  const Footage& footage_;
  int last_;
  const MapConfig& map_;
  bool own_pixels_only_;
  std::map<std::array<int, 4>, Told> told_;
};

// Sums of area by what is asked of ghosts; shares of them make the table.
struct GhostSums {
  double all = 0;
  std::array<double, 3> label{};     // background, mover, toy at rest
  std::array<double, 3> beside{};    // nearest to the table, the rest of the background, an object
  std::array<double, 3> distance{};  // to the nearest true surface: to 3 cm, to 9 cm, farther
  // Of the corners of the face's cube that are behind a surface by the mean of their observations:
  // seen free by some frame, by none; last: faces whose cube has no such corner.
  std::array<double, 3> cause{};
};

// Of what is charged: ghosts in space that is known to be free.
GhostSums SumGhosts(const Footage& footage, const SceneTruth& truth,
                    std::span<const PlacedTruth> current, const TriangleMesh& mesh,
                    const GhostScores& scores, const PipelineConfig& config,
                    const std::set<InstanceId>& movers) {
  const bool anchored = config.method == Method::kTsdfppAnchored;
  const double voxel_m = config.map.voxel_m;
  Observations observations(footage, truth.recent().back().index, config.map,
                            !IsOneField(config.method));
  const TrueModel& room = truth.surface(0).model();
  const NearestTruth nearest = FindNearestTruth(scores.samples.points, current);
  GhostSums sums;
  for (std::size_t i = 0; i < scores.samples.size(); ++i) {
    if (scores.sample_space[i] == GhostSpace::kUnseen) continue;
    const double area = scores.samples.area_m2[i];
    const InstanceId id = mesh.face_ids[scores.samples.triangle[i]];
    sums.all += area;
    sums.label[id == kBackground ? 0 : movers.contains(id) ? 1 : 2] += area;
    const bool by_room = nearest.object[i] == kBackground;
    const bool by_table =
        by_room && room.regions[room.face_region[nearest.triangle[i]]] == kTableRegion;
    sums.beside[by_table ? 0 : by_room ? 1 : 2] += area;
    const double far_m = nearest.distance_m[i];
    sums.distance[far_m <= kNear_m ? 0 : far_m <= kFar_m ? 1 : 2] += area;

    const auto own = std::find_if(footage.names.begin(), footage.names.end(),
                                  [&](const ObjectInfo& object) { return object.id == id; });
    const Pose& T_WO = truth.T_WO(static_cast<std::size_t>(own - footage.names.begin()));
    const auto& poses = truth.trajectories();
    const Pose T_WL = anchored && poses.contains(id) ? T_WO * poses.at(id).begin()->second.inverse()
                                                     : Pose::Identity();
    const Eigen::Vector3d q = T_WL.inverse() * scores.samples.points[i].cast<double>() / voxel_m;
    int behind = 0;
    int free = 0;
    for (int corner = 0; corner < 8; ++corner) {
      const Eigen::Vector3i voxel = q.array().floor().cast<int>().matrix() +
                                    Eigen::Vector3i(corner & 1, corner >> 1 & 1, corner >> 2);
      const Told& told = observations.Ask(id, voxel, T_WL, T_WO);
      if (told.mean_m >= 0) continue;
      ++behind;
      free += static_cast<int>(told.free);
    }
    if (behind == 0) {
      sums.cause[2] += area;
    } else {
      sums.cause[0] += area * free / behind;
      sums.cause[1] += area * (behind - free) / behind;
    }
  }
  return sums;
}

std::string WithError(const AreaEstimate& area) {
  return fmt::format("{} ±{}", Cell(kCm2PerM2 * area.area_m2, 0),
                     Cell(kCm2PerM2 * area.standard_error_m2, 1));
}

}  // namespace

Expected<void> MeasureGhosts(const FigureOptions& options) {
  const std::array<GhostFootage, 2> all{
      {{"mini", {"scenes/mini.toml", 1, 1, 40, {40}}, {1}},
       {"toycar3", {"scenes/toycar3.toml", 0.5, 1, 256, {256}}, {1, 2}}}};
  FigureTable table({"scene", "profile", "map", "when", "seen free cm2", "vacated cm2",
                     "unseen cm2", "background %", "movers %", "toys at rest %", "by the table %",
                     "by the room %", "by an object %", "to 3 cm %", "3 to 9 cm %", "over 9 cm %",
                     "seen free and averaged behind %", "behind and never seen free %",
                     "otherwise %"});
  for (const GhostFootage& scene : all) {
    TSDFPP_ASSIGN(const Footage footage, Film(scene.plan));
    const int frame = footage.truth_from.begin()->first;
    const SceneTruth& truth = *footage.truth_from.begin()->second;
    for (const char* profile : {"paper", "close"}) {
      for (const Method method :
           {Method::kTsdfStatic, Method::kTsdf, Method::kTsdfpp, Method::kTsdfppAnchored}) {
        PipelineConfig config;
        config.method = method;
        TSDFPP_RETURN_IF_ERROR(config.map.SetProfile(profile));
        SceneMeshes meshes;
        MapFootage(footage, config, {frame}, [&](int, const MapRepresentation& map) {
          SceneMesher mesher;
          meshes = MeshesOf(map, scene.movers, mesher);
        });
        for (const bool after : {false, true}) {
          const std::set<InstanceId> removed = after ? scene.movers : std::set<InstanceId>{};
          std::set<InstanceId> stay;
          for (const ObjectInfo& object : footage.names) {
            if (!removed.contains(object.id)) stay.insert(object.id);
          }
          const TriangleMesh& mesh = meshes.Without(removed);
          const std::vector<PlacedTruth> current = truth.PlacedWithout(removed);
          const GhostScores scores = ScoreGhosts(mesh, current, truth.PlacedWithout(stay),
                                                 config.map.voxel_m, truth.free_space());
          const GhostSums sums =
              SumGhosts(footage, truth, current, mesh, scores, config, scene.movers);
          std::vector<std::string> row{scene.name, profile, std::string(MethodName(method)),
                                       after ? "after" : "before"};
          for (const AreaEstimate& area : scores.space) row.push_back(WithError(area));
          for (const auto& parts : {sums.label, sums.beside, sums.distance, sums.cause}) {
            for (const double part : parts) {
              row.push_back(sums.all > 0 ? Cell(100 * part / sums.all, 0) : std::string());
            }
          }
          table.Add(std::move(row));
        }
      }
    }
  }
  return table.Write(options.out, "ghosts");
}

}  // namespace tsdfpp
