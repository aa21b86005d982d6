// The paper's tracker (III-D): each object that the frame shows is registered to its mesh in the
// map, from where it was.
#pragma once

#include "mapper/scene_mesher.h"
#include "mapper/track/icp_registration.h"
#include "mapper/track/tracker.h"

namespace tsdfpp {

class PclIcp : public Tracker {
 public:
  // The config must be valid.
  explicit PclIcp(const IcpConfig& config) : config_(config) {}

  // An object's frame O is its lattice: its pose is the identity where it is first seen, and that
  // before the frame where it is not seen or its registration fails.
  TrackedPoses Track(const Frame& frame, const cv::Mat& labels, const MapRepresentation& map,
                     const ObjectPoses& before) override;

 private:
  IcpConfig config_;
  SceneMesher mesher_;  // keeps the objects' meshes from frame to frame
};

}  // namespace tsdfpp
