// The term of a tracker that holds a model inside its segment's outline: what geometry leaves free,
// such as a box that slips along its flat sides, the outline often does not (docs/tracking.md).
#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "mapper/track/free_space.h"
#include "mapper/track/pose_least_squares.h"

namespace tsdfpp {

// How far each pixel near a segment is from it, and what may hide a model there.
struct SegmentOutline {
  cv::Rect box;    // of the image
  cv::Mat pixels;  // CV_32FC1 of the box's size: to the nearest pixel of the segment; 0 inside
  cv::Mat depth;   // CV_32FC1, a copy; 0 where the pixel is of no instance
  Intrinsics camera;
};

// Of the pixels labelled `id`; `points` are some of them. The box is wider by `margin_px` than the
// least one around the points.
SegmentOutline OutlineOf(const cv::Mat& labels, InstanceId id,
                         const std::vector<SegmentPoint>& points, const cv::Mat& depth,
                         const Intrinsics& camera, int margin_px);

// A place of the model that the camera should see, but that falls beside the segment, is as far off
// as the segment's nearest pixel at its depth, less a pixel and `slack_m`: an outline of voxels is
// not exact, and what it is off by would be fused and pull again. What lies behind what is seen
// there may be hidden, and counts for nothing; nor does what falls into the segment or beyond its
// box.
class OutlineTerm {
 public:
  struct Options {
    double weight = 1;    // of all places together, in points
    int max_places = 1;   // more are thinned evenly
    double margin_m = 0;  // what is seen nearer than a place by more hides it
    double slack_m = 0;
    double huber_m = 1;  // beyond it a residual counts linearly
  };

  // All are read while the term lives.
  OutlineTerm(const std::vector<SurfacePlace>& places, const SegmentOutline& outline,
              const MotionFrame& frame, const Options& options);

  // As DistanceTerm::Sums.
  NormalEquations Sums(const Pose& T_LC) const;

 private:
  const std::vector<SurfacePlace>* places_;
  const SegmentOutline* outline_;
  // How a place stands to the segment.
  struct Miss {
    double distance_m = 0;                              // 0 where it says nothing
    Eigen::Vector3d slope_C = Eigen::Vector3d::Zero();  // how it grows with the place
  };
  Miss MissOf(const Eigen::Vector3d& p_C, const Eigen::Vector3d& normal_C) const;

  MotionFrame frame_;
  Options options_;
  std::size_t count_;  // places that are taken
};

}  // namespace tsdfpp
