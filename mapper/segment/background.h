// Which pixels of a frame are furniture and room: a rule for one frame (docs/segmentation.md,
// "Background").
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>

#include "mapper/segment/components.h"
#include "mapper/segment/segment_planes.h"
#include "mapper/segment/surface_maps.h"

namespace tsdfpp {

inline constexpr std::int32_t kBackgroundLabel = 1;

// Holds the memory that the last frame took, and nothing else.
class BackgroundParter {
 public:
  // Gives these pixels of `labels` (CV_32SC1, labels below `end`, 0 is none) the background's
  // label, which no pixel may have before. Planes and what is near them are those of
  // segment_planes.h.
  // - The pixels near the plane of a segment that is large: at least config.plane_m2 of it, and at
  //   least half of the segment's pixels, are near the plane.
  // - Those of a wall: at least 0.005 m2, and four fifths of the segment's pixels, are near the
  //   plane, and at most a twentieth of what the frame shows lies behind it.
  // - Segments of which nine tenths are near one such plane.
  // - What lies within such a segment off its plane, by more than twice what is near, where it is
  //   connected in a part that is small. Larger such parts get labels from `end` on, in order of
  //   their first pixels.
  // Labelled pixels have a depth. Returns the number after the last label. The same for any number
  // of threads.
  std::int32_t Part(const SurfaceMaps& maps, const PixelLinks& links, const PartSize& least,
                    std::int32_t end, const DepthSegmentsConfig& config, cv::Mat& labels);

 private:
  SamplesByLabel samples_;
  cv::Mat off_;  // beyond twice what is near
};

}  // namespace tsdfpp
