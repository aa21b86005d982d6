// The paper's tracker (III-D): each object that the frame shows and that was classified is
// registered to its mesh in the map, from where it was.
#pragma once

#include <set>
#include <vector>

#include "mapper/scene_mesher.h"
#include "mapper/track/icp_registration.h"
#include "mapper/track/tracker.h"

namespace tsdfpp {

class PclIcp : public Tracker {
 public:
  // Of `objects` those with a semantic class are tracked. The config must be valid.
  PclIcp(const IcpConfig& config, const std::vector<ObjectInfo>& objects);

  // An object's frame O is its lattice: its pose is the identity where it is first seen, and that
  // before the frame where it is not seen or its registration fails.
  ObjectPoses Track(const Frame& frame, const cv::Mat& labels, const MapRepresentation& map,
                    const ObjectPoses& before) override;

 private:
  IcpConfig config_;
  std::set<InstanceId> tracked_;
  SceneMesher mesher_;  // keeps the objects' meshes from frame to frame
};

}  // namespace tsdfpp
