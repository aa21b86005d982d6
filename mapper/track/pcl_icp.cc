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

ObjectPoses PclIcp::Track(const Frame& frame, const cv::Mat& labels, const MapRepresentation& map,
                          const ObjectPoses& before) {
  ObjectPoses after = before;
  for (const InstanceId id : LabelsIn(labels)) {
    const auto known = before.find(id);
    if (known == before.end()) {
      after[id] = Pose::Identity();
      continue;
    }
    const TrackResult result = TrackObject(SegmentPoints(frame, labels, id, config_),
                                           map.ObjectMesh(id), map.config().voxel_m, config_);
    after[id] = result.T_O * known->second;
  }
  return after;
}

}  // namespace tsdfpp
