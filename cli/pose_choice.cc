#include "cli/pose_choice.h"

#include <fmt/format.h>

#include <algorithm>

namespace tsdfpp {

PoseChoice DefaultPoses(const SequenceInfo& info, AssociationMode associate,
                        const std::vector<Method>& methods) {
  const bool votes = associate == AssociationMode::kVotes;
  if (!votes && (info.has_object_poses || info.objects.size() <= 1)) return {};
  const bool have_distances = std::all_of(methods.begin(), methods.end(), [](Method method) {
    return CheckPoses(method, PoseSource::kTrack).has_value();
  });
  PoseChoice choice;
  choice.poses = have_distances ? PoseSource::kTrack : PoseSource::kIcp;
  if (!votes) {
    choice.remark = fmt::format(
        "{}: it holds no poses of objects, so they are tracked ({}); --poses gt maps them as "
        "standing still",
        info.name, PoseSourceName(choice.poses));
  }
  return choice;
}

}  // namespace tsdfpp
