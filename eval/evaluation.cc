#include "eval/evaluation.h"

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

std::unique_ptr<MapRepresentation> CopyWithout(const MapRepresentation& map,
                                               const std::set<InstanceId>& removed) {
  auto copy = map.Clone();
  for (const InstanceId id : removed) copy->Remove(id);
  return copy;
}

class Evaluator {
 public:
  Evaluator(const SceneTruth& truth, double voxel_m) : truth_(truth), voxel_m_(voxel_m) {}

  // Everything about object i on the scene mesh `mesh`, from which the other movers were removed.
  ObjectScores ScoreObject(std::size_t i, const ObjectInfo& info, const TriangleMesh& mesh,
                           const std::set<InstanceId>& removed, LastSeenStore& last_seen,
                           Selection* reconstructed_out) const {
    const SeenTracker& tracker = truth_.trackers()[i];
    const SampleSet& samples = tracker.samples_O();
    const Pose& T_WO = truth_.T_WO(i);
    const Selection within = ScoredSamples(truth_, i);
    const Selection seen = SelectSeen(tracker, within);
    const double limit_m = kThresholdsVoxels.back() * voxel_m_;

    ObjectScores scores;
    scores.info = info;
    const TriangleMesh faces = FacesOf(mesh, info.id);
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

    const SampleSet surface = SampleReconstruction(faces, {});
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
    scores.label_purity = ScoreLabelPurity(surface, info.id, truth_.PlacedWithout(removed));
    if (reconstructed_out != nullptr) *reconstructed_out = reconstructed;
    return scores;
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

}  // namespace

LastSeenStores MakeLastSeenStores(const SceneTruth& truth) {
  LastSeenStores stores;
  for (const SeenTracker& tracker : truth.trackers()) {
    stores.emplace_back(tracker.samples_O().size());
  }
  return stores;
}

Evaluation Evaluate(const MapRepresentation& map, const SceneTruth& truth,
                    const std::vector<ObjectInfo>& names, const std::set<InstanceId>& movers,
                    double voxel_m, LastSeenStores& last_seen) {
  Evaluation result;
  result.frame = truth.recent().back().index;
  auto start = Clock::now();
  result.scene = map.SceneMesh();
  result.mesh_s = Since(start);
  result.revealed = movers.empty() ? result.scene : CopyWithout(map, movers)->SceneMesh();
  std::map<InstanceId, TriangleMesh> alone;  // each mover with the other movers removed
  for (const InstanceId id : movers) {
    std::set<InstanceId> others = movers;
    others.erase(id);
    alone[id] = CopyWithout(map, others)->SceneMesh();
  }

  start = Clock::now();
  const auto score_objects = [&] {
    const Evaluator evaluator(truth, voxel_m);
    double visible_area = 0;
    double visible_present = 0;
    for (std::size_t i = 0; i < truth.trackers().size(); ++i) {
      const SeenTracker& tracker = truth.trackers()[i];
      const SampleSet& samples = tracker.samples_O();
      const InstanceId id = tracker.id();
      const bool moves = movers.contains(id);
      std::set<InstanceId> removed = movers;
      removed.erase(id);
      result.objects.push_back(evaluator.ScoreObject(
          i, names[i], moves ? alone[id] : result.revealed, removed, last_seen[i],
          id == kBackground ? &result.table_reconstructed : nullptr));

      const Selection visible = SelectSeenWith(tracker, SampleStatus::kVisible, SelectAll(samples));
      const Selection present = evaluator.ReconstructedOn(FacesOf(result.scene, id), i, visible);
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
  const auto score_scene = [&] {
    const GhostScores ghosts = ScoreGhosts(SampleReconstruction(result.scene, {}),
                                           truth.PlacedWithout({}), voxel_m, &truth.free_space());
    result.ghost_area_m2 = ghosts.area_m2;
    result.ghost_share = ghosts.share_of_mesh;
    result.revealed_ghost_area_m2 = ScoreGhosts(SampleReconstruction(result.revealed, {}),
                                                truth.PlacedWithout(movers), voxel_m, nullptr)
                                        .area_m2;
    result.sanity = ScoreSanity(result.scene, truth.recent(), voxel_m);
  };
  // Each writes its own part of the result.
  tbb::parallel_invoke(score_objects, score_scene);
  result.evaluate_s = Since(start);
  return result;
}

nlohmann::json ToJson(const Measured& measured) {
  if (measured.value) return *measured.value;
  return {{"value", nullptr}, {"why", measured.why_not}};
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

}  // namespace

nlohmann::json ToJson(const Evaluation& evaluation) {
  nlohmann::json objects = nlohmann::json::array();
  for (const ObjectScores& scores : evaluation.objects) objects.push_back(ToJson(scores));
  nlohmann::json sanity{{"all", ToJson(evaluation.sanity.all)}};
  for (const auto& [id, share] : evaluation.sanity.by_object) {
    sanity["objects"][std::to_string(id)] = ToJson(share);
  }
  return {{"frame", evaluation.frame},
          {"objects", objects},
          {"visible_completion", ToJson(evaluation.visible_completion)},
          {"ghost_area_m2", evaluation.ghost_area_m2},
          {"ghost_share", ToJson(evaluation.ghost_share)},
          {"revealed_ghost_area_m2", evaluation.revealed_ghost_area_m2},
          {"sanity", sanity},
          {"mesh_s", evaluation.mesh_s},
          {"evaluate_s", evaluation.evaluate_s}};
}

}  // namespace tsdfpp
