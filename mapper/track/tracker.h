// Where each object is after a frame (paper III-D): the third verb of the pipeline.
#pragma once

#include <map>
#include <string_view>

#include "core/error.h"
#include "core/types.h"
#include "mapper/map_representation.h"

namespace tsdfpp {

// T_WO by object.
using ObjectPoses = std::map<InstanceId, Pose>;

class Tracker {
 public:
  virtual ~Tracker() = default;

  // The objects' poses after the frame, of all that have had one, by their poses before it.
  // `labels` is the frame's objects that are tracked (mapper/track/tracked_objects.h), as
  // associated with the map, which holds what was fused before the frame; the rest is kBackground.
  virtual ObjectPoses Track(const Frame& frame, const cv::Mat& labels, const MapRepresentation& map,
                            const ObjectPoses& before) = 0;
};

enum class PoseSource {
  kGiven,  // Frame::T_WO
  kIcp,    // tracked; Frame::T_WO is not read
};

// "gt" or "icp". Errors: kUsage.
Expected<PoseSource> PoseSourceFromName(std::string_view name);
std::string_view PoseSourceName(PoseSource source);

}  // namespace tsdfpp
