// The trackers that bench/track.h measures, each fed frame by frame.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "core/error.h"
#include "mapper/pipeline.h"
#include "mapper/track/sdf_tracker.h"

namespace tsdfpp {

class TrackRun {
 public:
  virtual ~TrackRun() = default;
  virtual Expected<void> Process(const Frame& frame) = 0;
  // T_WO by object and frame, O as the run has it.
  virtual const std::map<InstanceId, std::map<int, Pose>>& trajectories() const = 0;
  virtual const TrackLog& log() const = 0;
  // Milliseconds of tracking, and objects that it was of, by frame with such objects.
  struct Cost {
    double track_ms = 0;
    int objects = 0;
  };
  const std::vector<Cost>& costs() const { return costs_; }

 protected:
  void AddCost(double track_ms, int objects) {
    if (objects > 0) costs_.push_back({track_ms, objects});
  }

 private:
  std::vector<Cost> costs_;
};

// A pipeline with given masks and ids.
std::unique_ptr<TrackRun> MakeMapRun(const std::vector<ObjectInfo>& objects,
                                     const PipelineConfig& config);

// True surfaces by object, as signed distances on the lattice of the object's own frame.
using KnownModels = std::map<InstanceId, TsdfGrid>;
KnownModels KnownModelsOf(const std::vector<TrueModel>& models, double voxel_m);

// Tracker `track` with those models, without keyframes, since nothing moves these. An object begins
// at its true pose, in the first frame in which it can be registered. `models` outlive the run.
std::unique_ptr<TrackRun> MakeKnownRun(const KnownModels& models, double voxel_m,
                                       const SdfTrackConfig& settings);

// What the terms know of each object at its true pose, with the true distances: the least shares
// of shifts and turns (KnownDirections), for the objects that the frame shows enough of.
struct LeastShares {
  double shift = 0;
  double turn = 0;
};
std::map<InstanceId, LeastShares> KnownShares(const Frame& frame, const KnownModels& models,
                                              double voxel_m, const SdfTrackConfig& settings);

}  // namespace tsdfpp
