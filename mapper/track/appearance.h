// What things look like from any side: their colours and how large they are.
#pragma once

#include <array>
#include <vector>

#include "core/types.h"
#include "mapper/track/segment_points.h"
#include "mapper/volume/tsdf_block.h"

namespace tsdfpp {

using Rgb = std::array<double, 3>;  // 0 to 255, in whichever order the frame has its channels

Rgb RgbOf(const cv::Vec3b& pixel);

// A colour without its brightness, and that. Dark colours have no chromaticity worth the name: a
// little grey added to all channels makes them grey.
inline constexpr double kAddedGrey = 12;
struct Chromatic {
  double first = 0;   // channel, of the sum of three, with grey added
  double second = 0;  // channel, likewise
  double sum = 0;     // of three channels with grey added
};
Chromatic ChromaticOf(const Rgb& colour);

struct Appearance {
  // Shares of colours: by chromaticity and brightness, each colour spread over the bins beside it.
  // Sums to 1; empty without colours.
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
