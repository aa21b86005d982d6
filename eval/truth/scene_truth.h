// The truth that evaluations are made against, followed through a sequence. The mapper never sees
// it.
#pragma once

#include <deque>
#include <memory>
#include <set>
#include <vector>

#include "core/frame_source.h"
#include "metrics/ghosts.h"
#include "metrics/truth_surface.h"
#include "metrics/visibility.h"

namespace tsdfpp {

// The name of the background's region under the moving objects, whose preservation is the question.
inline constexpr const char* kTableRegion = "table";

struct TruthOptions {
  SampleConfig sampling;        // of the true surfaces
  VisibilityConfig visibility;  // of the samples
  bool closed = true;           // the surfaces bound solids; else nothing is inside them
};

class SceneTruth {
 public:
  // Errors: those of FrameSource::Truth.
  static Expected<SceneTruth> Create(FrameSource& source, const TruthOptions& options = {});

  // Takes in a frame, in order. Objects without a pose in the frame stay where they were.
  // Errors: kData where the images do not fit.
  Expected<void> Observe(const Frame& frame);

  // By increasing id, background first; `trackers` and `surfaces` run in parallel.
  const std::vector<SeenTracker>& trackers() const { return trackers_; }
  const TruthSurface& surface(std::size_t i) const { return *surfaces_[i]; }
  const Pose& T_WO(std::size_t i) const { return T_WO_[i]; }
  const FreeSpace& free_space() const { return free_space_; }
  // All surfaces at their current poses, but for these objects.
  std::vector<PlacedTruth> PlacedWithout(const std::set<InstanceId>& removed) const;
  // The objects whose pose has changed so far.
  const std::set<InstanceId>& moved() const { return moved_; }
  const std::map<InstanceId, std::map<int, Pose>>& trajectories() const { return trajectories_; }

  // The last frames, the current one at the back; at most kRecentFrames.
  static constexpr std::size_t kRecentFrames = 3;
  const std::deque<Frame>& recent() const { return recent_; }

 private:
  std::vector<std::unique_ptr<TruthSurface>> surfaces_;
  std::vector<SeenTracker> trackers_;
  std::vector<Pose> T_WO_;
  std::set<InstanceId> moved_;
  std::map<InstanceId, std::map<int, Pose>> trajectories_;
  FreeSpace free_space_;
  std::deque<Frame> recent_;
};

// The objects whose removal the experiment is about: those that the scene names; in a scene that
// names none, those that have moved so far.
std::set<InstanceId> MoversNow(const SequenceInfo& info, const SceneTruth& truth);

}  // namespace tsdfpp
