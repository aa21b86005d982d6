// Labels beside outlines, by the surfaces on both sides: a point that does not go on from its own
// label's surface, but does from another one's, has been given the wrong label. A mask that bleeds
// over a step in depth, or over the edge where an object stands on a table, is so cut back, and one
// that ends too early grows.
#pragma once

#include <opencv2/core.hpp>

#include "core/types.h"
#include "mapper/segment/surface_maps.h"

namespace tsdfpp {

// An outline of a mask is at most so far from the true one, pixels.
inline constexpr int kOutlineReach_px = 4;
// Points on a side that have to say so. Of its own side it is a quarter at least: planes at an
// object's rim, which bends away, meet whatever is behind it.
inline constexpr int kLeastOnASide = 8;
inline constexpr double kOwnQuantile = 0.25;
// A point leaves its side where it is so many standard deviations of its depth off, and is another
// side's where it is so many times nearer to that.
inline constexpr float kOutlineSigmas = 2;
inline constexpr float kTimesNearer = 3;

struct OutlineLabels {
  cv::Mat labels;       // CV_16UC1
  cv::Mat is_doubtful;  // CV_8UC1, 255: beside an outline, and on neither side's surface
};

// `labels` (CV_16UC1) with the label of the surface that goes on at each pixel that has valid depth
// (`depth`, CV_32FC1, metres) and another label within kOutlineReach_px rows and columns. The side
// of a label are those pixels within twice as much about which all labels within kOutlineReach_px
// are one. A point's distance from a side is the kLeastOnASide-th least of the distances, along its
// ray, to the tangent planes of that side's points (`maps`); from its own the one at kOwnQuantile,
// if that is greater. Where its own is above `step_m` and kOutlineSigmas, and above kTimesNearer
// times another's (the least, of equal ones the lowest label's), the pixel becomes that one's; it
// is doubtful if that is nearer without being near. kNoInstance and pixels without a surface are on
// no side. In parallel, the same for any number of threads.
OutlineLabels LabelsByOutline(const SurfaceMaps& maps, const cv::Mat& depth, const cv::Mat& labels,
                              float step_m);

}  // namespace tsdfpp
