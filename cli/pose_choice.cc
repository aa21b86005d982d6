#include "cli/pose_choice.h"

#include <fmt/format.h>

#include <algorithm>

namespace tsdfpp {

PoseChoice PosesUnsaid(const SequenceInfo& info, AssociationMode associate,
                       const std::vector<Method>& methods) {
  const bool votes = associate == AssociationMode::kVotes;
  const bool are_given = info.has_object_poses || info.objects.size() <= 1;
  if (are_given && !votes) return {};
  const bool have_distances = std::all_of(methods.begin(), methods.end(), [](Method method) {
    return CheckPoses(method, PoseSource::kTrack).has_value();
  });
  PoseChoice choice;
  choice.poses = have_distances ? PoseSource::kTrack : PoseSource::kIcp;
  choice.remark =
      votes
          ? fmt::format("{}: the map's ids are its own, found by votes; poses are tracked ({})",
                        info.name, PoseSourceName(choice.poses))
          : fmt::format(
                "{}: it holds no poses of objects, so they are tracked ({}); --poses gt maps them "
                "as standing still",
                info.name, PoseSourceName(choice.poses));
  return choice;
}

}  // namespace tsdfpp
