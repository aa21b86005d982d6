// Which pixels of a frame are furniture and room: a rule for one frame (docs/segmentation.md,
// "Background").
#pragma once

#include <cstdint>
#include <vector>

#include "mapper/segment/components.h"
#include "mapper/segment/surface_maps.h"

namespace tsdfpp {

// The plane of most of a segment's pixels: `normal` * p_C = `distance_m`, normal towards the
// camera, distance negative.
struct SegmentPlane {
  bool is_plane = false;  // the rest means nothing where false
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
  double distance_m = 0;
  double area_m2 = 0;   // on the plane, of the segment's pixels that are near it
  double on_share = 0;  // of the segment's pixels, that are near it
};

// How far, along its ray, a pixel that is near a plane is from it at most: noise and a pixel's
// width.
inline double NearPlane_m(double sigma_m, double z_m, const PixelRays& rays,
                          const DepthSegmentsConfig& config) {
  return config.sigmas * sigma_m + rays.pixel_width * z_m;
}

// The planes of the labels below `end` of `labels` (CV_32SC1; 0 has none): least squares of inverse
// depth over every second row's every second pixel, at first over all, then three times over those
// within four, two and one times NearPlane_m.
std::vector<SegmentPlane> FitPlanes(const SurfaceMaps& maps, const cv::Mat& labels,
                                    std::int32_t end, const DepthSegmentsConfig& config);

// Gives the background label 1, which no pixel may have before:
// - the pixels near the plane of a segment that is large: at least config.plane_m2 of it, and at
//   least half of the segment's pixels, are near the plane;
// - those of a wall: at least 0.005 m2, and four fifths of the segment's pixels, are near the
// plane,
//   and at most a twentieth of what the frame shows lies behind it;
// - segments of which nine tenths are near one such plane;
// - what lies within such a segment off its plane, where it is connected in a part that is small.
// Larger
//   such parts get labels from `end` on, in order of their first pixels.
// A pixel is off a plane beyond twice NearPlane_m. Returns the number after the last label.
std::int32_t PartBackground(const SurfaceMaps& maps, const PixelLinks& links, const PartSize& least,
                            std::int32_t end, const DepthSegmentsConfig& config, cv::Mat& labels);
inline constexpr std::int32_t kBackgroundLabel = 1;

}  // namespace tsdfpp
