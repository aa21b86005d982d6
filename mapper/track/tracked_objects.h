// Which objects are tracked (paper III-D: those that were classified at some time).
#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "core/error.h"
#include "core/types.h"

namespace tsdfpp {

enum class TrackChoice {
  kAuto,        // kClassified from when on a class is known of any object, else kAll
  kClassified,  // those with a semantic class
  kAll,         // whatever is not background
  kMoving,      // the same, but what has not been seen to move yet stays where it was seen first
};

// "auto", "classified", "all" or "moving". Errors: kUsage.
Expected<TrackChoice> TrackChoiceFromName(std::string_view name);
std::string_view TrackChoiceName(TrackChoice choice);
// What that is, for a sentence. Not of kAuto.
std::string_view TrackChoiceText(TrackChoice choice);

class TrackedObjects {
 public:
  // `objects` are those known before the first frame.
  TrackedObjects(TrackChoice choice, const std::vector<ObjectInfo>& objects);

  // Takes in that a segment of the object was classified; the background is never tracked.
  void Learn(InstanceId id, const std::string& semantic_class);

  bool Contains(InstanceId id) const {
    if (id == kBackground || id == kNoInstance) return false;
    return choice() != TrackChoice::kClassified || classes_.contains(id);
  }
  // Not kAuto, but what that is now.
  TrackChoice choice() const;
  // The class that the object was given most often, the first in the alphabet of equally frequent
  // ones; empty where it has none.
  std::string ClassOf(InstanceId id) const;

  // The labels (CV_16UC1) with kNoInstance for objects that are not tracked: they are no
  // background, and may cover those that are. May share its pixels with `labels`.
  cv::Mat Select(const cv::Mat& labels) const;

 private:
  TrackChoice choice_;
  std::map<InstanceId, std::map<std::string, int>> classes_;  // how often; no background
};

}  // namespace tsdfpp
