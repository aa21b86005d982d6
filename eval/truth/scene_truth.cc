#include "eval/truth/scene_truth.h"

#include <algorithm>

#include "core/limits.h"
#include "core/one_line.h"
#include "metrics/mesh_tools.h"

namespace tsdfpp {

namespace {

constexpr double kSquareCentimetres = 1e4;  // in a square metre

}  // namespace

Expected<SceneTruth> SceneTruth::Create(FrameSource& source, const TruthOptions& options) {
  TSDFPP_ASSIGN(std::vector<TrueModel> models, source.Truth());
  std::sort(models.begin(), models.end(),
            [](const TrueModel& a, const TrueModel& b) { return a.info.id < b.info.id; });
  SceneTruth truth;
  for (TrueModel& model : models) {
    const InstanceId id = model.info.id;
    // A model in another unit would take more samples than there is memory.
    const double samples =
        SurfaceArea(model.mesh_O) * kSquareCentimetres * options.sampling.fine_per_cm2;
    constexpr double kMostSamples = 1e15;  // as a whole number
    TSDFPP_RETURN_IF_ERROR(CheckLimit(
        &Limits::mesh_elements, static_cast<std::int64_t>(std::min(samples, kMostSamples)),
        fmt::format("the true surface of {}", Quoted(model.info.name)), "samples"));
    const auto& surface = truth.surfaces_.emplace_back(
        std::make_unique<TruthSurface>(std::move(model), options.closed));
    truth.trackers_.emplace_back(
        WithoutInner(SampleModel(surface->model(), options.sampling), surface->solid_O()), id,
        options.visibility);
    truth.T_WO_.push_back(Pose::Identity());
  }
  return truth;
}

Expected<void> SceneTruth::Observe(const Frame& frame) {
  for (std::size_t i = 0; i < trackers_.size(); ++i) {
    const InstanceId id = trackers_[i].id();
    if (const auto given = frame.T_WO.find(id); given != frame.T_WO.end()) {
      auto& trajectory = trajectories_[id];
      if (!trajectory.empty() && trajectory.rbegin()->second.matrix() != given->second.matrix()) {
        moved_.insert(id);
      }
      trajectory[frame.index] = given->second;
      T_WO_[i] = given->second;
    }
    TSDFPP_RETURN_IF_ERROR(trackers_[i].Observe(frame, T_WO_[i]));
  }
  free_space_.Observe(frame);
  recent_.push_back(frame);
  if (recent_.size() > kRecentFrames) recent_.pop_front();
  return {};
}

std::vector<PlacedTruth> SceneTruth::PlacedWithout(const std::set<InstanceId>& removed) const {
  std::vector<PlacedTruth> placed;
  for (std::size_t i = 0; i < surfaces_.size(); ++i) {
    if (!removed.contains(surfaces_[i]->id())) placed.push_back({surfaces_[i].get(), T_WO_[i]});
  }
  return placed;
}

std::set<InstanceId> MoversNow(const SequenceInfo& info, const SceneTruth& truth) {
  if (!info.reveal || info.reveal->removed.empty()) return truth.moved();
  return {info.reveal->removed.begin(), info.reveal->removed.end()};
}

}  // namespace tsdfpp
