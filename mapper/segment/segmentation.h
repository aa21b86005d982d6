// What finds the segments of a frame (paper III-B; docs/segmentation.md), by name.
#pragma once

#include <string_view>

#include "core/error.h"

namespace tsdfpp {

enum class Segmentation {
  kGiven,  // Frame::mask
  kNone,   // Frame::mask is not read
  // Nor is it by these, whose ids are of one frame alone:
  kDepth,    // convex parts of the depth image
  kNetwork,  // instances that a network finds
  kFull,     // both, joined (paper III-B)
};

// "gt", "none", "depth", "network" or "full". Errors: kUsage.
Expected<Segmentation> SegmentationFromName(std::string_view name);
std::string_view SegmentationName(Segmentation segmentation);

// Whether segments have new ids in every frame, so that they must be associated by votes.
bool IdsAreOfOneFrame(Segmentation segmentation);
// Whether it takes settings of depth, and a network.
bool UsesDepth(Segmentation segmentation);
bool UsesNetwork(Segmentation segmentation);

}  // namespace tsdfpp
