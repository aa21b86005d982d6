#include "mapper/track/pcl_icp.h"

#include "mapper/track/segment_points.h"

namespace tsdfpp {

TrackedPoses PclIcp::Track(const Frame& frame, const cv::Mat& labels, const MapRepresentation& map,
                           const ObjectPoses& before) {
  TrackedPoses after{before};
  for (const auto& [id, pixels] : PixelsByLabel(labels, config_.mask_erosion_px)) {
    const auto known = before.find(id);
    if (known == before.end()) {
      after.T_WO[id] = Pose::Identity();
      after.seen[id] = TrackStatus::kBegun;
      continue;
    }
    const TrackResult result =
        TrackObject(SegmentPoints(frame, pixels, config_), mesher_.ObjectMesh(map, id),
                    map.config().voxel_m, config_);
    after.T_WO[id] = result.T_O * known->second;
    after.seen[id] = result.converged ? TrackStatus::kTracked : TrackStatus::kStayed;
  }
  return after;
}

}  // namespace tsdfpp
