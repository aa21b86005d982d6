// Does the visible scene look like what the camera sees? (docs/map.md, "Scene mesh"; the design's
// sanity rule)
#pragma once

#include <deque>
#include <map>

#include "core/types.h"
#include "eval/tools/rasteriser.h"
#include "metrics/measured.h"

namespace tsdfpp {

struct SanityScores {
  Measured all;                              // share of the mapped pixels that are right
  std::map<InstanceId, Measured> by_object;  // of each object's
};

inline constexpr double kSaneShareAll = 0.99;
inline constexpr double kSaneShareObject = 0.95;

// `raster` is `scene_W`, cast from the last frame's camera. A pixel is right where its depth is
// within one voxel of the frame's and its id is the mask's; a mesh without face ids is not asked
// for them. Mapped pixels: those of SeenByAll() (eval/score/mapped_pixels.h), but for those in
// EdgeBorder() and those seen at a steep incidence.
SanityScores ScoreSanity(const TriangleMesh& scene_W, const Raster& raster,
                         const std::deque<Frame>& recent, double voxel_m);

// The pixels (CV_8UC1, 255 or 0) that ScoreSanity counts.
cv::Mat MappedPixels(const std::deque<Frame>& recent, double voxel_m);

}  // namespace tsdfpp
