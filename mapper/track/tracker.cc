#include "mapper/track/tracker.h"

namespace tsdfpp {

Expected<PoseSource> PoseSourceFromName(std::string_view name) {
  if (name == "gt") return PoseSource::kGiven;
  if (name == "icp") return PoseSource::kIcp;
  return UsageError("pose source '{}' is unknown, expected gt or icp", name);
}

std::string_view PoseSourceName(PoseSource source) {
  return source == PoseSource::kGiven ? "gt" : "icp";
}

}  // namespace tsdfpp
