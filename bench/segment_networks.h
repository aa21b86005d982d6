// How good segments of depth, of our own network and of both joined are on the scenes.
#pragma once

#include <filesystem>
#include <string>

#include "core/error.h"

namespace tsdfpp {

// A table in CSV, a row a scene of `scenes`: panoptic quality, that of objects alone and IoU over
// the sequence (eval/score/segment_scores.h) of each way, over `frames` frames spread over it with
// a Kinect's noise of depth (nguyen2012) and of colour. Errors: those of opening and rendering the
// scenes.
Expected<std::string> NetworkScoresCsv(const std::filesystem::path& scenes, int frames);

}  // namespace tsdfpp
