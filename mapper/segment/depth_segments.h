// Segments from depth alone: surfaces between jumps and concave edges (paper III-B; Furrer et al.
// 2018; docs/segmentation.md).
#pragma once

#include "mapper/segment/background.h"
#include "mapper/segment/segmenter.h"
#include "mapper/segment/surface_maps.h"

namespace tsdfpp {

// Convex parts of what one frame shows. Holds the memory of the last frame's images and nothing
// else: a frame's segments depend on that frame alone.
class DepthSegments : public Segmenter {
 public:
  // The config must be valid.
  explicit DepthSegments(const DepthSegmentsConfig& config = {}) : config_(config) {}

  // Segments have ids from 1 on, the one of most pixels first, of equal ones that whose first pixel
  // comes first by row; kBackground is what background.h finds; kNoInstance where there is no
  // valid depth and on parts too small to be told from noise. Reads Frame::depth and
  // Frame::intrinsics. The same for any number of threads.
  // Errors: kData where depth is no CV_32FC1 image of the intrinsics' size, or falls into more than
  // 65534 segments.
  Expected<Segments> Segment(const Frame& frame) override;

 private:
  // Pixels whose eight neighbours and their neighbours neither jump nor are concave.
  void FindInner();
  Expected<cv::Mat> IdsOf(const Frame& frame, std::int32_t end) const;

  DepthSegmentsConfig config_;
  SurfaceMapper mapper_;
  BackgroundParter background_;
  const SurfaceMaps* maps_ = nullptr;
  cv::Mat edge_;
  cv::Mat inner_;
  cv::Mat labels_;
};

}  // namespace tsdfpp
