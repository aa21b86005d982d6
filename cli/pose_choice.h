// Where object poses come from if nobody says (`--poses` of `tsdfpp map` and `compare`).
#pragma once

#include <string>
#include <vector>

#include "core/frame_source.h"
#include "mapper/associate/associator.h"
#include "mapper/method_info.h"
#include "mapper/track/tracker.h"

namespace tsdfpp {

// For the option's help.
inline constexpr const char* kDefaultPosesHelp =
    "by default gt where the sequence has poses of objects and their ids, else track (icp where a "
    "method has no signed distances)";

struct PoseChoice {
  PoseSource poses = PoseSource::kGiven;
  std::string remark;  // for the log, that the sequence lacks poses; or empty
};

// Given poses where the frames have them, and where there is nothing but background. Else they are
// tracked: by signed distances, or by ICP where one of the methods has none. Ids of the map's own
// (votes) have no given poses.
PoseChoice DefaultPoses(const SequenceInfo& info, AssociationMode associate,
                        const std::vector<Method>& methods);

}  // namespace tsdfpp
