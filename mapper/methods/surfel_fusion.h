// A frame into lists of surfels (docs/map.md, "`surfels`"; Keller et al. 2013, section 4).
#pragma once

#include "mapper/map_config.h"
#include "mapper/methods/surfel_list.h"

namespace tsdfpp {

// Fuses the labelled pixels of a frame into the surfels of their objects, takes away surfels that
// the frame sees past and those that did not become stable in time, and adds surfels where pixels
// have none; new labels get an object. `now` is the number of the frame in the map, from 1. The
// frame must be one by CheckFrameForm (mapper/map_reach.h).
void FuseIntoSurfels(const Frame& frame, const cv::Mat& labels, const MapConfig& config,
                     std::uint32_t now, SurfelObjects& objects);

}  // namespace tsdfpp
