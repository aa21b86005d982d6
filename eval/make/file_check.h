// Are the files of a sequence those that were written?
#pragma once

#include <filesystem>
#include <vector>

#include "eval/make/frame_check.h"
#include "sequence/sequence_json.h"

namespace tsdfpp {

// Hashes, files that are missing or that nobody listed, and for every frame its three images.
std::vector<Finding> CheckFiles(const std::filesystem::path& folder, const SequenceRecord& record);

// Every frame has a camera pose, and a sensed one where these are listed; no pose is for
// a frame that there is not, every object but the background has a pose at least once, every object
// has a model.
std::vector<Finding> CheckTrajectories(const std::filesystem::path& folder,
                                       const SequenceRecord& record);

}  // namespace tsdfpp
