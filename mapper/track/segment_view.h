// What a frame's image has of one segment, for the terms that compare images: its outline and its
// grey values.
#pragma once

#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "core/types.h"

namespace tsdfpp {

// A value of an image between pixels, and its slopes along the columns and rows, a pixel.
struct ImageValue {
  bool is_known = false;
  double value = 0;
  Eigen::Vector2d slope = Eigen::Vector2d::Zero();
};

// A place on the outline of a segment, where what it is of ends before what is farther away.
struct RimPoint {
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
  double depth_m = 0;                                  // of the segment there
  Eigen::Vector2d outwards = Eigen::Vector2d::Zero();  // across the outline, of length 1
};

class SegmentView {
 public:
  // Of the pixels of `id` in `labels` (CV_16UC1, of the frame's size), of which there is one at
  // least. Those of kNoInstance are of the segment where they are as near to it as to others. Steps
  // of depth are more than `step_m`. Colour may be left out, which takes time. The frame is read
  // while the view lives.
  SegmentView(const Frame& frame, const cv::Mat& labels, InstanceId id, double step_m,
              bool has_colour = true);

  // The distance to the outline, pixels, negative inside; known up to some 20 pixels beside the
  // segment, where there is an outline in the picture.
  ImageValue OutlineAt(const Eigen::Vector2d& pixel) const;
  // Whether the outline that is nearest to a place is that of the object's surface at a depth. What
  // is inside is at that depth, but for a step: no part of the object that was hidden, or that lies
  // before it. And what is outside is farther away by more than a step: nothing is before the
  // object.
  bool IsOutlineOf(const Eigen::Vector2d& pixel, double depth_m) const;
  // The grey value, 0 to 255, smoothed by a Gauss function of one pixel; known where the picture
  // has colour, inside the segment by some pixels.
  ImageValue GreyAt(const Eigen::Vector2d& pixel) const;
  bool HasGrey() const { return !grey_.empty(); }
  // Whether the depth at a place is that, but for a step.
  bool IsAtDepth(const Eigen::Vector2d& pixel, double depth_m) const;

  // Points of its own outline, where the surface runs up to it: where it turns away, as a ball's
  // does, another part of it makes the outline as soon as it turns. An edge that is rounded over a
  // few pixels is one.
  std::vector<RimPoint> Rim() const;

 private:
  // Of the frame; 0 beyond it and where there is none.
  double DepthAt(const Eigen::Vector2d& pixel) const;
  // Of a place half a pixel beyond the outermost pixel; nothing where the surface turns away.
  std::optional<double> RimDepth(const Eigen::Vector2d& pixel,
                                 const Eigen::Vector2d& outwards) const;
  ImageValue ValueAt(const cv::Mat& image, const Eigen::Vector2d& pixel) const;

  const Frame* frame_;
  double step_m_;
  cv::Rect window_;  // of the frame
  cv::Mat outline_;  // CV_32FC1, of the window; empty where it has none
  cv::Mat grey_;     // CV_32FC1, of the window
};

}  // namespace tsdfpp
