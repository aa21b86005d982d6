// How good segments are: of depth alone and with our own network on scenes, and on a real shelf
// beside another network's.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/error.h"

namespace tsdfpp {

struct SegmentBenchOptions {
  std::vector<std::string> parts = {"scenes", "networks", "shelf"};
  std::string scenes = "scenes";  // a folder of scenes
  int frames = 8;                 // of a scene, spread over it
  std::string shelf = "../shared/data/apc_shelf_scene0000";
  std::string out;
};

// Writes scenes.csv, the scores (eval/score/segment_scores.h) of each scene with exact depth and
// with nguyen2012's noise; networks.csv (bench/segment_networks.h); and shelf.csv, those of depth
// and of the network's masks that came with the shelf, over all pixels with depth and over those in
// the bin whose objects are labelled. Errors: those of opening and rendering the scenes and of
// reading the shelf.
Expected<void> RunSegmentBench(const SegmentBenchOptions& options);

}  // namespace tsdfpp
