#include "mapper/track/given_poses.h"

namespace tsdfpp {

TrackedPoses GivenPoses::Track(const Frame& frame, const cv::Mat& /*labels*/,
                               const MapRepresentation& /*map*/, const ObjectPoses& before) {
  TrackedPoses after{before};
  for (const auto& [id, T_WO] : frame.T_WO) after.T_WO[id] = T_WO;
  return after;
}

}  // namespace tsdfpp
