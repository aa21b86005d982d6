#include "mapper/segment/surface_maps.h"

#include "mapper/segment/surface_edges.h"
#include "mapper/segment/surface_normals.h"

namespace tsdfpp {

const SurfaceMaps& SurfaceMapper::Compute(const cv::Mat& depth, const Intrinsics& intrinsics,
                                          const DepthSegmentsConfig& config) {
  maps_.rays = RaysOf(intrinsics);
  const float pixel = maps_.rays.pixel_width;
  TakeInverse(depth, measured_);
  BridgeGaps(pixel, config, measured_, maps_.inverse_depth, bridged_);
  maps_.reach = ChooseReach(depth, pixel, config);
  Smooth(bridged_, maps_.reach.smooth_px, pixel, config, measured_, maps_.inverse_depth,
         maps_.depth);
  ComputeNormals(maps_.rays, maps_.reach, config, maps_.inverse_depth, maps_.normal, maps_.sigma);
  FindJumps(maps_.rays, maps_.reach, config, maps_.inverse_depth, maps_.sigma, maps_.reach_right,
            maps_.reach_down);
  FindConcave(maps_.rays, maps_.reach, config, maps_.depth, maps_.sigma, maps_.reach_right,
              maps_.reach_down, maps_.concave);
  return maps_;
}

}  // namespace tsdfpp
