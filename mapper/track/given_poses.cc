#include "mapper/track/given_poses.h"

namespace tsdfpp {

ObjectPoses GivenPoses::Track(const Frame& frame, const cv::Mat& /*labels*/,
                              const MapRepresentation& /*map*/, const ObjectPoses& before) {
  ObjectPoses after = before;
  for (const auto& [id, T_WO] : frame.T_WO) after[id] = T_WO;
  return after;
}

}  // namespace tsdfpp
