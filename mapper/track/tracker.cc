#include "mapper/track/tracker.h"

#include <cstdlib>

namespace tsdfpp {

Expected<PoseSource> PoseSourceFromName(std::string_view name) {
  if (name == "gt") return PoseSource::kGiven;
  if (name == "icp") return PoseSource::kIcp;
  if (name == "track") return PoseSource::kTrack;
  return UsageError("pose source '{}' is unknown, expected gt, icp or track", name);
}

std::string_view PoseSourceName(PoseSource source) {
  switch (source) {
    case PoseSource::kGiven:
      return "gt";
    case PoseSource::kIcp:
      return "icp";
    case PoseSource::kTrack:
      return "track";
  }
  std::abort();
}

std::string_view PoseSourceTitle(PoseSource source) {
  switch (source) {
    case PoseSource::kGiven:
      return "given poses";
    case PoseSource::kIcp:
      return "ICP";
    case PoseSource::kTrack:
      return "tracked";
  }
  std::abort();
}

Expected<void> CheckPoses(Method method, PoseSource poses) {
  if (poses != PoseSource::kTrack || InfoOf(method).has_voxels) return {};
  return UsageError(
      "poses '{}' are tracked by signed distances, which method '{}' has not, expected gt or icp",
      PoseSourceName(poses), MethodName(method));
}

}  // namespace tsdfpp
