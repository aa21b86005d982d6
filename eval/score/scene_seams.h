// Seams of the visible scene: background that is missing beside what stands on it. `sane` leaves
// out edges; this looks at nothing else (docs/metrics.md, `seam`).
#pragma once

#include <deque>

#include "core/types.h"
#include "eval/tools/rasteriser.h"
#include "metrics/measured.h"

namespace tsdfpp {

struct SeamScore {
  Measured share;            // of the pixels asked, those that are seams
  Measured in_front;         // those that something hides
  double area_m2 = 0;        // of true surface that the seams' pixels see
  double asked_area_m2 = 0;  // that all pixels asked see
};

struct SeamScores {
  SeamScore beside_objects;  // in the border of the objects' outlines alone
  SeamScore elsewhere;       // in that of the background's own steps, such as the table's rim
  cv::Mat seams;             // CV_8UC1, 255 at a seam
};

// `depth` (CV_32FC1, metres along the optical axis, 0 where nothing is hit) is the visible scene
// cast from the last frame's camera.
// Asked are the pixels of the last frame that lie in EdgeBorder(), show the background, are in
// SeenByAll() and are seen at less than the steepest incidence at which a sample counts as seen. A
// pixel is a *seam* where the cast hits nothing, or something more than a voxel behind the true
// depth; it is hidden (`in_front`) where the cast hits something more than a voxel in front of it,
// such as an object that is too large, or a background that goes on too far.
// A pixel (x, y) at depth z sees z^2 / (fx fy |n d|) of the surface's plane, with n its unit normal
// and d = ((x - cx) / fx, (y - cy) / fy, 1): the pixel's footprint over the cosine of incidence. n
// comes from the differences of the neighbouring points; across an edge of id, or of depth by two
// voxels, nothing is taken from the other side, and a pixel with edges on both sides in a row or
// column is not asked.
SeamScores ScoreSeams(const cv::Mat& depth, const std::deque<Frame>& recent, double voxel_m);

}  // namespace tsdfpp
