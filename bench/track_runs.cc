#include "bench/track_runs.h"

#include <utility>

#include "bench/clocks.h"
#include "bench/known_models.h"
#include "mapper/segment/bleeding.h"

namespace tsdfpp {
namespace {

// Points further from the surface than this are outliers for any tracker.
constexpr double kKnownBand_voxels = 10;

class MapRun : public TrackRun {
 public:
  MapRun(const PipelineConfig& config, const std::vector<ObjectInfo>& objects)
      : pipeline_(config, objects) {}

  Expected<void> Process(const Frame& frame) override {
    TSDFPP_ASSIGN(const StepTimes times, pipeline_.Process(frame));
    int tracked = 0;
    for (const auto& [id, span] : log().objects()) {
      tracked += span.tracked + span.stayed + span.frozen;
    }
    AddCost(1e3 * times.track_s, tracked - std::exchange(tracked_, tracked));
    return {};
  }
  const std::map<InstanceId, std::map<int, Pose>>& trajectories() const override {
    return pipeline_.trajectories();
  }
  const TrackLog& log() const override { return pipeline_.track_log(); }

 private:
  Pipeline pipeline_;
  int tracked_ = 0;  // objects and frames so far
};

class KnownRun : public TrackRun {
 public:
  KnownRun(const KnownModels& models, double voxel_m, const SdfTrackConfig& settings)
      : tracker_(settings, [this, &models](const MapRepresentation&,
                                           InstanceId id) { return ModelAt(models, id); }),
        bleeding_step_m_(static_cast<float>(kBleedingStep_voxels * voxel_m)) {
    MapConfig config;
    config.voxel_m = voxel_m;
    no_map_ = MakeMap(Method::kVolumes, config);
  }

  Expected<void> Process(const Frame& frame) override {
    // An object that is new is at its true pose, which the tracker takes for one of before.
    before_ = frame.T_WO;
    for (const auto& [id, T_WO] : T_WO_) before_[id] = T_WO;
    const double began_ms = WallMilliseconds();
    const cv::Mat labels = WithoutBleeding(frame.depth, frame.mask, bleeding_step_m_);
    TrackedPoses after = tracker_.Track(frame, labels, *no_map_, before_);
    int tracked = 0;
    for (auto& [id, status] : after.seen) {
      if (T_WO_.contains(id)) {
        ++tracked;
        T_WO_[id] = after.T_WO.at(id);
      } else if (status == TrackStatus::kTracked) {
        status = TrackStatus::kBegun;
        T_WO_[id] = frame.T_WO.at(id);
      }
    }
    AddCost(WallMilliseconds() - began_ms, tracked);
    for (const auto& [id, T_WO] : T_WO_) trajectories_[id][frame.index] = T_WO;
    log_.Add(frame.index, after);
    return {};
  }
  const std::map<InstanceId, std::map<int, Pose>>& trajectories() const override {
    return trajectories_;
  }
  const TrackLog& log() const override { return log_; }

 private:
  std::optional<ObjectModel> ModelAt(const KnownModels& models, InstanceId id) const {
    const auto model = models.find(id);
    if (model == models.end()) return std::nullopt;
    return ObjectModel{&model->second, before_.at(id)};
  }

  SdfTracker tracker_;
  float bleeding_step_m_;
  std::unique_ptr<MapRepresentation> no_map_;
  ObjectPoses before_;  // the frame, of all objects
  ObjectPoses T_WO_;    // after it, of those that have begun
  std::map<InstanceId, std::map<int, Pose>> trajectories_;
  TrackLog log_;
};

}  // namespace

std::unique_ptr<TrackRun> MakeMapRun(const std::vector<ObjectInfo>& objects,
                                     const PipelineConfig& config) {
  return std::make_unique<MapRun>(config, objects);
}

KnownModels KnownModelsOf(const std::vector<TrueModel>& models, double voxel_m) {
  KnownModels known;
  for (const TrueModel& model : models) {
    if (model.info.id == kBackground) continue;
    known.emplace(model.info.id, GridOfSolid(model.mesh_O, voxel_m, kKnownBand_voxels));
  }
  return known;
}

std::unique_ptr<TrackRun> MakeKnownRun(const KnownModels& models, double voxel_m,
                                       const SdfTrackConfig& settings) {
  return std::make_unique<KnownRun>(models, voxel_m, settings);
}

std::map<InstanceId, LeastShares> KnownShares(const Frame& frame, const KnownModels& models,
                                              double voxel_m, const SdfTrackConfig& settings) {
  std::map<InstanceId, LeastShares> shares;
  for (const auto& [id, pixels] : PixelsByLabel(frame.mask, settings.mask_erosion_px)) {
    const auto model = models.find(id);
    const auto points = SegmentPointsOf(frame, pixels, voxel_m, settings);
    if (model == models.end() || points.size() < static_cast<std::size_t>(settings.min_points)) {
      continue;
    }
    const SurfaceReader reader(model->second, voxel_m);
    SdfRegistration task{&reader, points, voxel_m, frame.intrinsics};
    task.T_LC_expected = frame.T_WO.at(id).inverse() * frame.T_WC;
    task.is_near = true;
    const KnownDirections known = RegisterToDistances(task, settings).known;
    shares[id] = {known.shift_shares[0], known.turn_shares[0]};
  }
  return shares;
}

}  // namespace tsdfpp
