// How the surfaces of a frame's objects face the camera, by which distances along its rays become
// distances from these surfaces (docs/map.md, "Distances from the surface").
#pragma once

#include <opencv2/core.hpp>

#include "core/types.h"

namespace tsdfpp {

// CV_32FC1 of the frame's size: what a distance along a pixel's ray, in front of what is seen
// there, is multiplied by. With the cosine of the angle between the ray and the normal of the
// surface it would be the distance from the surface's tangent plane. It is that cosine over the one
// of 45 degrees, at most 1: what is seen less aslant keeps its distance along the ray. So 1 to
// 0.14.
//
// The normal is that of a plane. Inverse depths on a plane are linear in the picture; their slopes
// are those of a least-squares fit over the pixels with the same label within 3 rows and columns,
// or over a quarter of them beside an edge. A pixel where neither lies on a plane takes the mean of
// those beside it; 1 without such, without depth or a label, and on the background. `labels` is
// CV_16UC1, of the frame's size. In parallel; deterministic.
cv::Mat FacingOf(const Frame& frame, const cv::Mat& labels);

}  // namespace tsdfpp
