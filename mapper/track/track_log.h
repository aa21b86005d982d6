// What was tracked in a run, and when.
#pragma once

#include <map>
#include <optional>

#include "mapper/track/tracker.h"

namespace tsdfpp {

// Of one object.
struct TrackSpan {
  int first = 0;    // the frame at which it began, or of a map that was loaded the first with it
  int last = 0;     // the last one at which it was registered, or began
  int tracked = 0;  // frames at which it was registered
  int stayed = 0;   // that showed it, but not where it is, and were fused
  int frozen = 0;   // and were not
  int lost = 0;     // times that it was seen not to be in its place (mapper/track/lost_objects.h)
  int found = 0;    // times that it was found again
  int begun_anew = 0;  // times that its place on the model was not found, or was found wrongly
  std::optional<int> moved{};  // the first frame with it in TrackedPoses::moved
  bool operator==(const TrackSpan&) const = default;
};

class TrackLog {
 public:
  void Add(int frame, const TrackedPoses& tracked);

  void AddLost(InstanceId id) { ++objects_[id].lost; }
  void AddFound(InstanceId id) { ++objects_[id].found; }
  void AddBegunAnew(InstanceId id) { ++objects_[id].begun_anew; }

  // Frames that were added.
  int frames() const { return frames_; }
  // No object was registered in any frame.
  bool IsEmpty() const;
  const std::map<InstanceId, TrackSpan>& objects() const { return objects_; }
  // By object and frame; of trackers that know (TrackedPoses::motions).
  const std::map<InstanceId, std::map<int, MotionUncertainty>>& motions() const { return motions_; }

 private:
  int frames_ = 0;
  std::map<InstanceId, TrackSpan> objects_;
  std::map<InstanceId, std::map<int, MotionUncertainty>> motions_;
};

}  // namespace tsdfpp
