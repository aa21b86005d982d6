#include "mapper/track/tracked_objects.h"

#include <cstdlib>

namespace tsdfpp {

Expected<TrackChoice> TrackChoiceFromName(std::string_view name) {
  for (const TrackChoice choice :
       {TrackChoice::kAuto, TrackChoice::kClassified, TrackChoice::kAll}) {
    if (name == TrackChoiceName(choice)) return choice;
  }
  return UsageError("choice of what is tracked '{}' is unknown, expected auto, classified or all",
                    name);
}

std::string_view TrackChoiceName(TrackChoice choice) {
  switch (choice) {
    case TrackChoice::kAuto:
      return "auto";
    case TrackChoice::kClassified:
      return "classified";
    case TrackChoice::kAll:
      return "all";
  }
  std::abort();
}

TrackedObjects::TrackedObjects(TrackChoice choice, const std::vector<ObjectInfo>& objects)
    : choice_(choice) {
  for (const ObjectInfo& object : objects) {
    if (object.id != kBackground && !object.semantic_class.empty()) classified_.insert(object.id);
  }
  if (choice_ == TrackChoice::kAuto) {
    choice_ = classified_.empty() ? TrackChoice::kAll : TrackChoice::kClassified;
  }
}

}  // namespace tsdfpp
