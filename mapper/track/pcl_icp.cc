#include "mapper/track/pcl_icp.h"

#include <set>

namespace tsdfpp {
namespace {

std::set<InstanceId> LabelsIn(const cv::Mat& labels) {
  std::set<InstanceId> ids;
  InstanceId last = kNoInstance;
  for (int v = 0; v < labels.rows; ++v) {
    const auto* row = labels.ptr<InstanceId>(v);
    for (int u = 0; u < labels.cols; ++u) {
      if (row[u] != last) ids.insert(last = row[u]);
    }
  }
  ids.erase(kBackground);
  ids.erase(kNoInstance);
  return ids;
}

}  // namespace

TrackedPoses PclIcp::Track(const Frame& frame, const cv::Mat& labels, const MapRepresentation& map,
                           const ObjectPoses& before) {
  TrackedPoses after{before};
  for (const InstanceId id : LabelsIn(labels)) {
    const auto known = before.find(id);
    if (known == before.end()) {
      after.T_WO[id] = Pose::Identity();
      after.seen[id] = TrackStatus::kBegun;
      continue;
    }
    const TrackResult result =
        TrackObject(SegmentPoints(frame, labels, id, config_), mesher_.ObjectMesh(map, id),
                    map.config().voxel_m, config_);
    after.T_WO[id] = result.T_O * known->second;
    after.seen[id] = result.converged ? TrackStatus::kTracked : TrackStatus::kStayed;
  }
  return after;
}

}  // namespace tsdfpp
