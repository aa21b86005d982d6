#include "mapper/track/tracked_objects.h"

#include <algorithm>
#include <cstdlib>

namespace tsdfpp {

Expected<TrackChoice> TrackChoiceFromName(std::string_view name) {
  for (const TrackChoice choice :
       {TrackChoice::kAuto, TrackChoice::kClassified, TrackChoice::kAll, TrackChoice::kMoving}) {
    if (name == TrackChoiceName(choice)) return choice;
  }
  return UsageError(
      "choice of what is tracked '{}' is unknown, expected auto, classified, all or "
      "moving",
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
    case TrackChoice::kMoving:
      return "moving";
  }
  std::abort();
}

std::string_view TrackChoiceText(TrackChoice choice) {
  switch (choice) {
    case TrackChoice::kClassified:
      return "what has a class";
    case TrackChoice::kAll:
      return "all that is not background";
    case TrackChoice::kMoving:
      return "all that is not background, once it is seen to move";
    case TrackChoice::kAuto:
      break;
  }
  std::abort();
}

TrackedObjects::TrackedObjects(TrackChoice choice, const std::vector<ObjectInfo>& objects)
    : choice_(choice) {
  for (const ObjectInfo& object : objects) Learn(object.id, object.semantic_class);
}

void TrackedObjects::Learn(InstanceId id, const std::string& semantic_class) {
  if (id != kBackground && !semantic_class.empty()) ++classes_[id][semantic_class];
}

TrackChoice TrackedObjects::choice() const {
  if (choice_ != TrackChoice::kAuto) return choice_;
  return classes_.empty() ? TrackChoice::kAll : TrackChoice::kClassified;
}

std::string TrackedObjects::ClassOf(InstanceId id) const {
  const auto found = classes_.find(id);
  if (found == classes_.end()) return "";
  return std::max_element(found->second.begin(), found->second.end(),
                          [](const auto& a, const auto& b) { return a.second < b.second; })
      ->first;
}

cv::Mat TrackedObjects::Select(const cv::Mat& labels) const {
  if (choice() != TrackChoice::kClassified) return labels;
  cv::Mat selected = labels.clone();
  InstanceId last = kBackground;
  bool is_last_left_out = false;
  for (int v = 0; v < selected.rows; ++v) {
    auto* row = selected.ptr<InstanceId>(v);
    for (int u = 0; u < selected.cols; ++u) {
      if (row[u] != last) {
        last = row[u];
        is_last_left_out = last != kNoInstance && last != kBackground && !Contains(last);
      }
      if (is_last_left_out) row[u] = kNoInstance;
    }
  }
  return selected;
}

}  // namespace tsdfpp
