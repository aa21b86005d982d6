// What things look like from any side: their colours and how large they are.
#pragma once

#include <vector>

#include "core/types.h"
#include "mapper/track/segment_points.h"
#include "mapper/volume/tsdf_block.h"

namespace tsdfpp {

struct Appearance {
  // Shares of colours: by chromaticity (red and green of their sum with blue, in whichever order
  // the frame has its channels) and brightness, each colour spread over the bins beside it. Sums to
  // 1; empty without colours.
  std::vector<float> colours;
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();  // metres, of each axis
  double radius_m = 0;                               // about it, within which four of five are
  int points = 0;
};

Appearance AppearanceOf(const Frame& frame, const std::vector<SegmentPoint>& points);
// Of its voxels at the surface.
Appearance AppearanceOf(const TsdfGrid& model, double voxel_m);

// What two have in common of their colours, 0 to 1; 1 where one has none.
double ColoursInCommon(const Appearance& a, const Appearance& b);

// Whether a segment of the one can be of the other by its size: both may lack a side.
bool IsOfSize(const Appearance& segment, const Appearance& model, double voxel_m);

}  // namespace tsdfpp
