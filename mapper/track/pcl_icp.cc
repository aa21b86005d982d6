#include "mapper/track/pcl_icp.h"

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
  ids.erase(kNoInstance);
  return ids;
}

}  // namespace

PclIcp::PclIcp(const IcpConfig& config, const std::vector<ObjectInfo>& objects) : config_(config) {
  for (const ObjectInfo& object : objects) {
    if (object.id != kBackground && !object.semantic_class.empty()) tracked_.insert(object.id);
  }
}

ObjectPoses PclIcp::Track(const Frame& frame, const cv::Mat& labels, const MapRepresentation& map,
                          const ObjectPoses& before) {
  ObjectPoses after = before;
  for (const InstanceId id : LabelsIn(labels)) {
    if (!tracked_.contains(id)) continue;
    const auto known = before.find(id);
    if (known == before.end()) {
      after[id] = Pose::Identity();
      continue;
    }
    const TrackResult result =
        TrackObject(SegmentPoints(frame, labels, id, config_), mesher_.ObjectMesh(map, id),
                    map.config().voxel_m, config_);
    after[id] = result.T_O * known->second;
  }
  return after;
}

}  // namespace tsdfpp
