// Segments of a real shelf beside the masks of a network (docs/segmentation.md, "A real shelf").
#pragma once

#include <filesystem>

#include "core/error.h"
#include "eval/score/segment_scores.h"

namespace tsdfpp {

struct ShelfScores {
  struct Of {
    SegmentScores in_bin;  // what lies outside of the labelled bin is unknown
    SegmentScores all;     // it is background
  };
  Of depth;    // DepthSegments with its defaults
  Of network;  // the masks that came with the data
};

// Of the folder apc_shelf_scene0000. Errors: kData where a file is missing or unusable.
Expected<ShelfScores> ScoreShelf(const std::filesystem::path& folder);

}  // namespace tsdfpp
