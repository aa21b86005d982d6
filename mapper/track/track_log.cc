#include "mapper/track/track_log.h"

#include <algorithm>

namespace tsdfpp {

void TrackLog::Add(int frame, const TrackedPoses& tracked) {
  ++frames_;
  for (const auto& [id, motion] : tracked.motions) motions_[id][frame] = motion;
  for (const auto& [id, status] : tracked.seen) {
    TrackSpan& span = objects_.try_emplace(id, TrackSpan{frame, frame}).first->second;
    const bool was_tracked = span.tracked > 0;
    switch (status) {
      case TrackStatus::kBegun:
        // One that begins anew began before.
        if (!was_tracked) span.first = frame;
        span.last = frame;
        break;
      case TrackStatus::kTracked:
        span.last = frame;
        ++span.tracked;
        break;
      case TrackStatus::kStayed:
        ++span.stayed;
        break;
      case TrackStatus::kFrozen:
        ++span.frozen;
        break;
    }
  }
  for (const InstanceId id : tracked.moved) {
    TrackSpan& span = objects_[id];
    if (!span.moved) span.moved = frame;
  }
}

bool TrackLog::IsEmpty() const {
  return std::all_of(objects_.begin(), objects_.end(),
                     [](const auto& object) { return object.second.tracked == 0; });
}

}  // namespace tsdfpp
