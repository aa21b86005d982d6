// Are the files of a sequence those that were written?
#pragma once

#include <filesystem>
#include <vector>

#include "eval/make/frame_check.h"
#include "sequence/sequence_json.h"
#include "sim/config/scene_config.h"

namespace tsdfpp {

// Hashes, files that are missing or that nobody listed, and for every frame its three images
// (and what a sensor made of depth and mask, where it did).
std::vector<Finding> CheckFiles(const std::filesystem::path& folder, const SequenceRecord& record);

// Every frame has a camera pose, and a sensed one where these are listed; no pose is for
// a frame that there is not, every object but the background has a pose at least once, every object
// has a model.
std::vector<Finding> CheckTrajectories(const std::filesystem::path& folder,
                                       const SequenceRecord& record);

// Where sequence.json is not what the scene in scene.toml makes, or has a certificate that no sound
// sequence gets. `of_scene` is what the scene says of itself.
std::vector<Finding> CheckRecord(const SequenceRecord& record, const SceneConfig& scene,
                                 const SequenceInfo& of_scene);
std::vector<Finding> CheckCertificate(const SequenceRecord& record);

}  // namespace tsdfpp
