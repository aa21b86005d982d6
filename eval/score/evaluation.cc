#include "eval/score/evaluation.h"

#include <tbb/parallel_invoke.h>

#include <chrono>

#include "metrics/mesh_tools.h"

namespace tsdfpp {
namespace {

using Clock = std::chrono::steady_clock;

double Since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

// The samples that an object is scored on: the table's, where it is the background.
Selection ScoredSamples(const SceneTruth& truth, std::size_t i) {
  const SampleSet& samples = truth.trackers()[i].samples_O();
  const std::vector<std::string>& regions = truth.surface(i).model().regions;
  if (truth.trackers()[i].id() == kBackground) {
    for (std::size_t region = 0; region < regions.size(); ++region) {
      if (regions[region] == kTableRegion) {
        return SelectRegion(samples, static_cast<std::uint16_t>(region));
      }
    }
  }
  return SelectAll(samples);
}

std::optional<std::uint16_t> ScoredRegion(const SceneTruth& truth, std::size_t i) {
  const std::vector<std::string>& regions = truth.surface(i).model().regions;
  for (std::size_t region = 0; region < regions.size(); ++region) {
    if (truth.trackers()[i].id() == kBackground && regions[region] == kTableRegion) {
      return static_cast<std::uint16_t>(region);
    }
  }
  return std::nullopt;
}

// The faces of `id` that matter to the selected samples: those within the largest threshold.
SurfaceIndex IndexNear(const TriangleMesh& faces, const SampleSet& samples_O,
                       const Selection& selected, const Pose& T_WO, double margin_m) {
  Eigen::AlignedBox3f box;
  for (std::size_t i = 0; i < samples_O.size(); ++i) {
    if (selected[i] != 0) box.extend((T_WO * samples_O.points[i].cast<double>()).cast<float>());
  }
  if (box.isEmpty()) return SurfaceIndex(TriangleMesh{});
  const auto margin = Eigen::Vector3f::Constant(static_cast<float>(margin_m));
  return SurfaceIndex(FacesNear(faces, {box.min() - margin, box.max() + margin}));
}

constexpr const char* kNoLabels = "the mesh has no labels";

class Evaluator {
 public:
  Evaluator(const SceneTruth& truth, double voxel_m) : truth_(truth), voxel_m_(voxel_m) {}

  // Everything about object i on the scene mesh `mesh`, from which the other movers were removed.
  // `unlabelled` are samples of a mesh without labels, by the object that each is nearest to; null
  // where there are labels.
  ObjectScores ScoreObject(std::size_t i, const ObjectInfo& info, const TriangleMesh& mesh,
                           const std::vector<SampleSet>* unlabelled, LastSeenStore& last_seen,
                           Selection* reconstructed_out) const {
    const SeenTracker& tracker = truth_.trackers()[i];
    const SampleSet& samples = tracker.samples_O();
    const Pose& T_WO = truth_.T_WO(i);
    const Selection within = ScoredSamples(truth_, i);
    const Selection seen = SelectSeen(tracker, within);
    const double limit_m = kThresholdsVoxels.back() * voxel_m_;

    ObjectScores scores;
    scores.info = info;
    const TriangleMesh own = unlabelled == nullptr ? FacesOf(mesh, info.id) : TriangleMesh{};
    const TriangleMesh& faces = unlabelled == nullptr ? own : mesh;
    const SampleMatch match = MatchSamples(
        samples, seen, T_WO, IndexNear(faces, samples, seen, T_WO, kSearchMargin_m), limit_m);
    const Selection reconstructed = Reconstructed(match, voxel_m_);
    // What the object's own faces reconstruct, faces of any label do: only the rest is asked again.
    Selection missing = SelectHidden(tracker, within);
    for (std::size_t k = 0; k < missing.size(); ++k) missing[k] = missing[k] & !reconstructed[k];
    Selection any =
        Reconstructed(MatchSamples(samples, missing, T_WO,
                                   IndexNear(mesh, samples, missing, T_WO, limit_m), limit_m),
                      voxel_m_);
    for (std::size_t k = 0; k < any.size(); ++k) any[k] = any[k] | reconstructed[k];
    scores.preserved = ScorePreservation(tracker, within, reconstructed, last_seen, &any);
    last_seen.Update(reconstructed, SelectSeenWith(tracker, SampleStatus::kVisible, within));
    scores.completion = CompletionDistances(samples, seen, match);

    const SampleSet surface =
        unlabelled == nullptr ? SampleReconstruction(faces, {}) : (*unlabelled)[i];
    std::vector<double> thresholds_m;
    thresholds_m.reserve(kThresholdsVoxels.size());
    for (const double voxels : kThresholdsVoxels) thresholds_m.push_back(voxels * voxel_m_);
    scores.accuracy =
        ScoreAccuracy(surface, {&truth_.surface(i), T_WO}, ScoredRegion(truth_, i), thresholds_m);
    for (std::size_t k = 0; k < thresholds_m.size(); ++k) {
      scores.recall[k] =
          ShareOf(samples, seen, Reconstructed(match, thresholds_m[k]), "nothing was seen yet");
      scores.f_score[k] = FScore(scores.accuracy.precision[k], scores.recall[k]);
    }
    // The map has lost the movers, the world has not: their crust under another name is impure.
    scores.label_purity = unlabelled == nullptr
                              ? ScoreLabelPurity(surface, info.id, truth_.PlacedWithout({}))
                              : Measured::Undefined(kNoLabels);
    if (reconstructed_out != nullptr) *reconstructed_out = reconstructed;
    return scores;
  }

  // Samples of a mesh without labels, split by the true surface that is nearest.
  std::vector<SampleSet> SplitByNearest(const SampleSet& samples_W) const {
    const NearestTruth nearest = FindNearestTruth(samples_W.points, truth_.PlacedWithout({}));
    std::vector<SampleSet> parts(truth_.trackers().size());
    for (std::size_t k = 0; k < samples_W.size(); ++k) {
      for (std::size_t i = 0; i < parts.size(); ++i) {
        if (truth_.trackers()[i].id() != nearest.object[k]) continue;
        parts[i].points.push_back(samples_W.points[k]);
        parts[i].normals.push_back(samples_W.normals[k]);
        parts[i].region.push_back(samples_W.region[k]);
        parts[i].triangle.push_back(samples_W.triangle[k]);
        parts[i].area_m2.push_back(samples_W.area_m2[k]);
      }
    }
    return parts;
  }

  // Share of the selected samples of object i that the mesh has.
  Selection ReconstructedOn(const TriangleMesh& faces, std::size_t i,
                            const Selection& selected) const {
    const SampleSet& samples = truth_.trackers()[i].samples_O();
    const Pose& T_WO = truth_.T_WO(i);
    return Reconstructed(
        MatchSamples(samples, selected, T_WO, IndexNear(faces, samples, selected, T_WO, voxel_m_),
                     voxel_m_),
        voxel_m_);
  }

 private:
  // Completion distances are exact up to this.
  static constexpr double kSearchMargin_m = 0.2;

  const SceneTruth& truth_;
  double voxel_m_;
};

// Ghosts after the removal of `movers`; `revealed` is null where nothing can be removed.
void ScoreRevealedGhosts(const TriangleMesh* revealed, const SceneTruth& truth,
                         const std::set<InstanceId>& movers, double voxel_m, Evaluation& result) {
  for (Measured* each : {&result.revealed_ghost_area_m2, &result.revealed_ghost_error_m2,
                         &result.revealed_unseen_area_m2, &result.revealed_unseen_error_m2}) {
    *each = Measured::Undefined(kNoLabels);
  }
  if (revealed == nullptr) return;
  std::set<InstanceId> stay;
  for (const SeenTracker& tracker : truth.trackers()) {
    if (!movers.contains(tracker.id())) stay.insert(tracker.id());
  }
  const GhostScores scores = ScoreGhosts(*revealed, truth.PlacedWithout(movers),
                                         truth.PlacedWithout(stay), voxel_m, truth.free_space());
  const AreaEstimate& unseen = scores.space[static_cast<std::size_t>(GhostSpace::kUnseen)];
  result.revealed_ghost_area_m2 = Measured::Of(scores.ghosts.area_m2);
  result.revealed_ghost_error_m2 = Measured::Of(scores.ghosts.standard_error_m2);
  result.revealed_unseen_area_m2 = Measured::Of(unseen.area_m2);
  result.revealed_unseen_error_m2 = Measured::Of(unseen.standard_error_m2);
}

// What is scored of the scene as a whole: surfaces in free space, what the camera sees, seams.
void ScoreScene(const SceneMeshes& meshes, const SceneTruth& truth,
                const std::set<InstanceId>& movers, double voxel_m, Evaluation& result) {
  const TriangleMesh& revealed = meshes.Without(movers);
  const GhostScores ghosts =
      ScoreGhosts(meshes.scene, truth.PlacedWithout({}), {}, voxel_m, truth.free_space());
  result.ghost_area_m2 = ghosts.ghosts.area_m2;
  result.ghost_error_m2 = ghosts.ghosts.standard_error_m2;
  result.ghost_share = ghosts.share_of_mesh;
  ScoreRevealedGhosts(meshes.labelled ? &revealed : nullptr, truth, movers, voxel_m, result);
  const Frame& now = truth.recent().back();
  const Raster raster = Rasterise(meshes.scene, now.intrinsics, now.T_WC);
  result.sanity = ScoreSanity(meshes.scene, raster, truth.recent(), voxel_m);
  result.seams = ScoreSeams(raster.depth, truth.recent(), voxel_m);
}

}  // namespace

LastSeenStores MakeLastSeenStores(const SceneTruth& truth) {
  LastSeenStores stores;
  for (const SeenTracker& tracker : truth.trackers()) {
    stores.emplace_back(tracker.samples_O().size());
  }
  return stores;
}

const TriangleMesh& SceneMeshes::Without(const std::set<InstanceId>& removed) const {
  return removed.empty() || !labelled ? scene : without.at(removed);
}

std::set<std::set<InstanceId>> RemovalsOf(const std::set<InstanceId>& movers) {
  std::set<std::set<InstanceId>> removals{movers};
  for (const InstanceId id : movers) {
    std::set<InstanceId> others = movers;
    others.erase(id);
    removals.insert(std::move(others));
  }
  return removals;
}

SceneMeshes MeshesOf(const MapRepresentation& map, const std::set<InstanceId>& movers,
                     SceneMesher& mesher) {
  SceneMeshes meshes;
  const auto start = Clock::now();
  meshes.scene = mesher.SceneMesh(map);
  meshes.mesh_s = Since(start);
  for (const std::set<InstanceId>& removed : RemovalsOf(movers)) {
    if (removed.empty()) continue;
    const auto copy = map.Clone();
    for (const InstanceId id : removed) copy->Remove(id);
    meshes.without[removed] = copy->SceneMesh();
  }
  return meshes;
}

Evaluation Evaluate(const MapRepresentation& map, const SceneTruth& truth,
                    const std::vector<ObjectInfo>& names, const std::set<InstanceId>& movers,
                    double voxel_m, LastSeenStores& last_seen) {
  SceneMesher mesher;
  return EvaluateMeshes(MeshesOf(map, movers, mesher), truth, names, movers, voxel_m, last_seen);
}

Evaluation EvaluateMeshes(SceneMeshes meshes, const SceneTruth& truth,
                          const std::vector<ObjectInfo>& names, const std::set<InstanceId>& movers,
                          double voxel_m, LastSeenStores& last_seen) {
  Evaluation result;
  result.frame = truth.recent().back().index;
  result.labelled = meshes.labelled;
  result.mesh_s = meshes.mesh_s;
  const TriangleMesh& revealed = meshes.Without(movers);

  const auto start = Clock::now();
  const auto score_objects = [&] {
    const Evaluator evaluator(truth, voxel_m);
    std::vector<SampleSet> nearest;
    if (!meshes.labelled)
      nearest = evaluator.SplitByNearest(SampleReconstruction(meshes.scene, {}));
    double visible_area = 0;
    double visible_present = 0;
    for (std::size_t i = 0; i < truth.trackers().size(); ++i) {
      const SeenTracker& tracker = truth.trackers()[i];
      const SampleSet& samples = tracker.samples_O();
      const InstanceId id = tracker.id();
      std::set<InstanceId> removed = movers;
      removed.erase(id);
      result.objects.push_back(evaluator.ScoreObject(
          i, names[i], meshes.Without(removed), meshes.labelled ? nullptr : &nearest, last_seen[i],
          id == kBackground ? &result.table_reconstructed : nullptr));

      const Selection visible = SelectSeenWith(tracker, SampleStatus::kVisible, SelectAll(samples));
      const Selection present =
          meshes.labelled ? evaluator.ReconstructedOn(FacesOf(meshes.scene, id), i, visible)
                          : evaluator.ReconstructedOn(meshes.scene, i, visible);
      Selection both = visible;
      Selection scored = ScoredSamples(truth, i);
      for (std::size_t k = 0; k < both.size(); ++k) {
        both[k] = visible[k] & present[k];
        scored[k] = scored[k] & visible[k];
      }
      visible_area += SelectedArea_m2(samples, visible);
      visible_present += SelectedArea_m2(samples, both);
      result.objects.back().visible_completion =
          ShareOf(samples, scored, present, "nothing that was seen is visible");
    }
    result.visible_completion = visible_area > 0 ? Measured::Of(visible_present / visible_area)
                                                 : Measured::Undefined("nothing seen is visible");
  };
  const auto score_scene = [&] { ScoreScene(meshes, truth, movers, voxel_m, result); };
  // Each writes its own part of the result.
  tbb::parallel_invoke(score_objects, score_scene);
  result.evaluate_s = Since(start);
  result.revealed = revealed;
  result.scene = std::move(meshes.scene);
  return result;
}

namespace {

nlohmann::json ToJson(const DistanceSummary& summary) {
  return {{"mean_m", tsdfpp::ToJson(summary.mean_m)},
          {"rmse_m", tsdfpp::ToJson(summary.rmse_m)},
          {"p95_m", tsdfpp::ToJson(summary.p95_m)}};
}

nlohmann::json ToJson(const ObjectScores& scores) {
  const PreservationScores& p = scores.preserved;
  nlohmann::json thresholds = nlohmann::json::array();
  for (std::size_t k = 0; k < kThresholdsVoxels.size(); ++k) {
    thresholds.push_back({{"voxels", kThresholdsVoxels[k]},
                          {"precision", tsdfpp::ToJson(scores.accuracy.precision[k])},
                          {"recall", tsdfpp::ToJson(scores.recall[k])},
                          {"f_score", tsdfpp::ToJson(scores.f_score[k])}});
  }
  nlohmann::json hidden;
  for (std::size_t k = 0; k < kHidingCauses.size(); ++k) {
    const HiddenScores& of_cause = p.by_cause[k];
    hidden[kHidingCauseNames[k]] = {{"area_cm2", of_cause.area_cm2},
                                    {"lost_area_cm2", tsdfpp::ToJson(of_cause.lost_area_cm2)},
                                    {"preservation", tsdfpp::ToJson(of_cause.preservation)},
                                    {"preservation_any_label", tsdfpp::ToJson(of_cause.any_label)},
                                    {"retention", tsdfpp::ToJson(of_cause.retention)}};
  }
  return {{"id", scores.info.id},
          {"name", scores.info.name},
          {"completion", tsdfpp::ToJson(p.completion)},
          {"visible_completion", tsdfpp::ToJson(scores.visible_completion)},
          {"preservation", tsdfpp::ToJson(p.preservation)},
          {"preservation_behind_other", tsdfpp::ToJson(p.preservation_behind_other)},
          {"preservation_behind_itself", tsdfpp::ToJson(p.preservation_behind_itself)},
          {"preservation_outside", tsdfpp::ToJson(p.preservation_outside)},
          {"preservation_any_label", tsdfpp::ToJson(p.by_cause[0].any_label)},
          {"hidden", hidden},
          {"retention", tsdfpp::ToJson(p.retention)},
          {"retention_behind_other", tsdfpp::ToJson(p.retention_behind_other)},
          {"hole_area_cm2", tsdfpp::ToJson(p.hole_area_cm2)},
          {"seen_area_cm2", p.seen_area_cm2},
          {"visible_area_cm2", p.visible_area_cm2},
          {"hidden_area_cm2", p.hidden_area_cm2},
          {"behind_other_area_cm2", p.behind_other_area_cm2},
          {"accuracy", ToJson(scores.accuracy.distance)},
          {"bias_m", tsdfpp::ToJson(scores.accuracy.bias_m)},
          {"completion_distance", ToJson(scores.completion)},
          {"at", thresholds},
          {"label_purity", tsdfpp::ToJson(scores.label_purity)}};
}

nlohmann::json ToJson(const SeamScore& score) {
  const Measured area = score.share.value ? Measured::Of(1e4 * score.area_m2) : score.share;
  return {{"share", tsdfpp::ToJson(score.share)},
          {"in_front", tsdfpp::ToJson(score.in_front)},
          {"area_cm2", tsdfpp::ToJson(area)},
          {"asked_area_cm2", 1e4 * score.asked_area_m2}};
}

}  // namespace

nlohmann::json ToJson(const ObjectTrajectoryScores& scores) {
  return {{"frames", scores.frames},
          {"ate_rmse_m", ToJson(scores.ate_rmse_m)},
          {"rotation_rmse_deg", ToJson(scores.rotation_rmse_deg)},
          {"cofusion_rmse_m", ToJson(scores.cofusion_rmse_m)},
          {"rpe_rmse_m", ToJson(scores.rpe_rmse_m)},
          {"rpe_rmse_deg", ToJson(scores.rpe_rmse_deg)}};
}

nlohmann::json ToJson(const Evaluation& evaluation) {
  nlohmann::json objects = nlohmann::json::array();
  for (const ObjectScores& scores : evaluation.objects) objects.push_back(ToJson(scores));
  nlohmann::json sanity{{"all", ToJson(evaluation.sanity.all)}};
  for (const auto& [id, share] : evaluation.sanity.by_object) {
    sanity["objects"][std::to_string(id)] = ToJson(share);
  }
  const auto of_ghosts = [&](const Measured& area) {
    return ToJson(KnowsBackground(evaluation) ? area : Measured::Undefined(kNoTrueBackground));
  };
  return {{"frame", evaluation.frame},
          {"labelled", evaluation.labelled},
          {"objects", objects},
          {"visible_completion", ToJson(evaluation.visible_completion)},
          {"ghost_area_m2", of_ghosts(Measured::Of(evaluation.ghost_area_m2))},
          {"ghost_error_m2", of_ghosts(Measured::Of(evaluation.ghost_error_m2))},
          {"ghost_share", of_ghosts(evaluation.ghost_share)},
          {"revealed_ghost_area_m2", of_ghosts(evaluation.revealed_ghost_area_m2)},
          {"revealed_ghost_error_m2", of_ghosts(evaluation.revealed_ghost_error_m2)},
          {"revealed_unseen_area_m2", of_ghosts(evaluation.revealed_unseen_area_m2)},
          {"revealed_unseen_error_m2", of_ghosts(evaluation.revealed_unseen_error_m2)},
          {"sanity", sanity},
          {"seams",
           {{"beside_objects", ToJson(evaluation.seams.beside_objects)},
            {"elsewhere", ToJson(evaluation.seams.elsewhere)}}},
          {"mesh_s", evaluation.mesh_s},
          {"evaluate_s", evaluation.evaluate_s}};
}

}  // namespace tsdfpp
