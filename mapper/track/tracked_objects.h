// Which objects are tracked (paper III-D: those that were classified at some time).
#pragma once

#include <set>
#include <string_view>
#include <vector>

#include "core/error.h"
#include "core/types.h"

namespace tsdfpp {

enum class TrackChoice {
  kAuto,        // kClassified where a class is known of any object, else kAll
  kClassified,  // those with a semantic class
  kAll,         // whatever is not background
};

// "auto", "classified" or "all". Errors: kUsage.
Expected<TrackChoice> TrackChoiceFromName(std::string_view name);
std::string_view TrackChoiceName(TrackChoice choice);

class TrackedObjects {
 public:
  // `objects` are those of the sequence.
  TrackedObjects(TrackChoice choice, const std::vector<ObjectInfo>& objects);

  bool Contains(InstanceId id) const {
    if (id == kBackground || id == kNoInstance) return false;
    return choice_ == TrackChoice::kAll || classified_.contains(id);
  }
  // kClassified or kAll.
  TrackChoice choice() const { return choice_; }

 private:
  TrackChoice choice_;
  std::set<InstanceId> classified_;  // the background excluded
};

}  // namespace tsdfpp
